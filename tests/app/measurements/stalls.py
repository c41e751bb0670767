"""Setup script of a measured server: writes the longest gap of its event loop, second by second.

`panel serve app --setup stalls.py` with STALLS naming the file: lines of (time, longest gap, of
which the loop's thread computed) in s. The rest of a gap went to others on the same cores, such as
the browser.
"""

import os
import time

from tornado.ioloop import IOLoop

TICK = 0.005
_last, _spent = time.perf_counter(), time.thread_time()
_longest, _second = (0.0, 0.0), 0


def tick():
    """Measure the time since the tick before, less what it was asked to wait."""
    global _last, _spent, _longest, _second
    now, spent = time.perf_counter(), time.thread_time()
    _longest = max(_longest, (now - _last - TICK, spent - _spent))
    _last, _spent = now, spent
    if int(time.time()) != _second:
        _second = int(time.time())
        with open(os.environ["STALLS"], "a") as log:
            log.write(f"{time.time():.2f} {_longest[0]:.4f} {_longest[1]:.4f}\n")
        _longest = (0.0, 0.0)
    IOLoop.current().call_later(TICK, tick)


IOLoop.current().call_later(TICK, tick)
