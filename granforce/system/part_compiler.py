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
        return self.serialize_using_bitcode()


class PartCompiler(Compiler):  # type: ignore[misc]
    """Numba's compiler, for functions called only by kernels."""

    def define_pipelines(self) -> Any:
        self.state.library = _Part(self.state.targetctx.codegen(), self.state.func_id.func_name)
        return super().define_pipelines()
