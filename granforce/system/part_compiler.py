"""Compile parts of kernels once: optimised only inside the kernels that contain them.

Numba compiles every function separately, and again within each function that calls it: code five
calls deep is optimised five times, and its own machine code is never called. Functions called only
by kernels stay unoptimised here; the optimiser sees them, whole, in the kernels that Python calls.
Results are the same, as it may not change the rounding of any operation.
"""

from typing import Any

from llvmlite import binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.dispatcher import Dispatcher
from numba.core.types.misc import unliteral

# What kept parts are marked with, besides numba's "bitcode" and "object".
_PART = "part"


class _Part(JITCodeLibrary):  # type: ignore[misc]  # numba has no type hints
    """Code that others link, neither optimised nor run separately."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        # Numba sets the address of the function's environment, which must therefore exist.
        environments = [
            str(variable)
            for variable in self._final_module.global_variables
            if variable.linkage == binding.Linkage.common
        ]
        self._codegen._add_module(binding.parse_assembly("\n".join(environments)))
        self._codegen._engine.finalize_object()
        self._finalize_dynamic_globals()
        self._finalized = True

    def serialize_using_object_code(self) -> Any:
        name, _, code = self.serialize_using_bitcode()
        return name, _PART, code


class PartCompiler(Compiler):  # type: ignore[misc]
    """Numba's compiler, for functions called only by kernels."""

    def define_pipelines(self) -> Any:
        self.state.library = _Part(self.state.targetctx.codegen(), self.state.func_id.func_name)
        return super().define_pipelines()


def _keep_parts() -> None:
    """Make numba load kept parts as parts.

    It would make them machine code, which kernels that link them later would run in place of their
    own: a factorisation took eight times as long in the process that compiled it.
    """
    read = JITCodeLibrary._unserialize

    def unserialize(cls: Any, codegen: Any, state: Any) -> Any:
        name, kind, code = state
        if kind != _PART:
            return read(codegen, state)
        part = _Part(codegen, name)
        part._final_module = binding.parse_bitcode(code)
        part._finalize_final_module()
        return part

    JITCodeLibrary._unserialize = classmethod(unserialize)


def _compile_once_for_all_constants() -> None:
    """Make numba compile a part for the type of an integer, and not again for each constant."""
    typed = Dispatcher.get_call_template

    def typed_by_kind(self: Any, args: Any, kws: Any) -> Any:
        if self._compiler.pipeline_class is PartCompiler:
            args = tuple(map(unliteral, args))
        return typed(self, args, kws)

    Dispatcher.get_call_template = typed_by_kind  # type: ignore[method-assign]


_keep_parts()
_compile_once_for_all_constants()
