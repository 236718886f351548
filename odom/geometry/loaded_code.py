"""Loads compiled code in less time and memory than numba itself, which makes ready to compile more at each load.

It keeps the intermediate code of each function in memory, parsed, beside the machine code: only another function that
is compiled anew and calls that one needs it. And it looks through everything that it can compile.
"""

from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.runtime.nrt import rtsys


class LoadedLibrary(JITCodeLibrary):
    """The code of one function: where it comes from disk, its intermediate code is parsed only when it is needed."""

    _intermediate: bytes | None = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, kind, data = state
        if kind != "object":
            return super()._unserialize(codegen, state)  # type: ignore[no-untyped-call]  # numba gives no types
        machine_code, intermediate = data
        library = codegen.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        library._intermediate = intermediate
        return library

    def get_pointer_to_function(self, name: str) -> Any:
        """Return the address of the function's wrapper."""
        if self._intermediate is None:
            return super().get_pointer_to_function(name)  # type: ignore[no-untyped-call]  # numba gives no types
        return self._codegen._engine.get_function_address(name)

    def _get_module_for_linking(self) -> Any:
        if self._intermediate is not None and self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self._intermediate)
            engine = self._codegen._engine
            engine._load_defined_symbols(self._shared_module)  # type: ignore[no-untyped-call]  # numba gives no types
        return super()._get_module_for_linking()  # type: ignore[no-untyped-call]  # numba gives no types


def make_ready(target_context: Any) -> None:
    """Prepare for running what is loaded; what is needed to compile more, numba looks for when it does."""
    target_context.codegen()._library_class = LoadedLibrary
    rtsys.initialize(target_context)
