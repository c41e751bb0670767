// Actions of buttons and keys, by name, on a player.

/** name → function; all are inactive while a packing is being made. */
export function actions(player) {
  const loaded = (action) => (given) => { if (player.replay && !player.live.moves) action(player.replay, given) }
  const halted = (action) => loaded((replay, given) => {
    player.hand.free()
    player.playback.newest = false
    player.play(false)
    action(replay, given)
  })
  const { model, tell } = player
  // The networks to be played have the held forces: others are replaced first.
  const played = (action) => (given) => (model.ignoring ? tell({ sample: true }) : action(given))
  return {
    less: loaded(() => player.hand.nudge(-1)),
    more: loaded(() => player.hand.nudge(1)),
    hold: loaded((replay) => player.hold(replay)),
    least: loaded(() => player.hand.pullToEnd(-1)),
    largest: loaded(() => player.hand.pullToEnd(1)),
    pull: loaded(() => player.hand.pullTo(player.buttons.force)),
    undo: loaded((replay) => { if (replay.held && !player.pushed.held) tell({ undo: true }) }),
    free: loaded(() => player.hand.free()),
    play: played(loaded(() => {
      player.hand.free()
      player.toggle()
    })),
    step: played(halted((replay) => player.show(Math.floor(replay.position + 1e-9) + 1))),
    back: played(halted((replay) => player.show(Math.ceil(replay.position - 1e-9) - 1))),
    restart: halted(() => player.show(0)),
    end: played(halted((replay) => player.show(replay.last))),
    next: loaded((replay) => player.choose(replay, 1)),
    previous: loaded((replay) => player.choose(replay, -1)),
    scrub: played(halted((replay, to) => player.show(to))),
    keep: (number) => tell({ keep: number }),
    tab: (number) => tell({ tab: number }),
  }
}
