"""Kernels loaded from disk without what only compiling needs.

Before Numba loads a kernel it makes its compiler ready, and it reads the kernel's intermediate code, in case another one is
compiled that calls it. Here both wait until something is compiled. This knows Numba from the inside: `_kernel_cache` uses
it with the releases it was tried with, and where it fails, Numba loads the kernel.
"""

from __future__ import annotations

import logging
from typing import Any

import llvmlite.binding as llvm
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import compile_result
from numba.core.runtime import rtsys

log = logging.getLogger("fastcontact")


def quicken(cache: Any) -> None:
    """Let a cache load its kernels by `_Cache` and `_Kernels`."""
    cache.__class__, cache._impl.__class__ = _Cache, _Kernels


class _Cache(FunctionCache):
    """A cache whose kernels are loaded without the tables of what may be compiled."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a kernel from disk, None if it is not there."""
        try:
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
            return None  # an error of the file system was passed over
        except Exception as error:
            log.debug("a kernel is loaded by Numba's own way: %r", error)
            self._impl.__class__ = CompileResultCacheImpl  # from now on; the compiler is ready then, and once is enough
            return super().load_overload(sig, target_context)


class _Kernels(CompileResultCacheImpl):
    """What is kept of kernels, made into kernels again without reading their intermediate code."""

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return a kernel: `CompileResult._rebuild`, with a library of its own."""
        state, description, environment, signature, objectmode, lifted, annotation, reload, environments = payload
        for start in reload or ():
            start()
        library = _Library(target_context.codegen(), state[0])
        library.take(state, [description.llvm_func_name, description.llvm_cpython_wrapper_name])
        found = compile_result(
            target_context=target_context, typing_context=target_context.typing_context, library=library,
            environment=environment, entry_point=target_context.get_executable(library, description, environment),
            fndesc=description, type_annotation=annotation, signature=signature, objectmode=objectmode, lifted=lifted,
            reload_init=reload, referenced_envs=environments,
        )  # fmt: skip
        for other in environments:
            library.codegen.set_env(other.env_name, other)
        return found


class _Library(JITCodeLibrary):
    """Machine code whose intermediate code is read when another kernel is compiled that calls this one."""

    _intermediate = b""

    def take(self, state: tuple[str, str, tuple[bytes, bytes]], names: list[str]) -> None:
        """Take what Numba wrote (name, kind, code), in which the functions `names` are called from outside."""
        _, kind, (machine, self._intermediate) = state
        if kind != "object":
            raise ValueError(f"code of another kind: {kind}")
        self.enable_object_caching()
        self._set_compiled_object(machine)
        self._finalize_final_module()
        self._codegen._engine._defined_symbols.update(names)

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function; those seldom called from outside are known from the intermediate code."""
        engine = self._codegen._engine
        if self._intermediate and not engine.is_symbol_defined(name):
            engine._load_defined_symbols(self._get_module_for_linking())
        return int(super().get_pointer_to_function(name))

    def _get_module_for_linking(self) -> Any:
        if self._intermediate:
            self._shared_module, self._intermediate = llvm.parse_bitcode(self._intermediate), b""
        return super()._get_module_for_linking()
