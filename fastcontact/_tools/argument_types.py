"""Type checks of the arguments of public functions and methods.

The annotation of an argument determines its allowed types. Numbers are real numbers, including those of NumPy but not
Booleans. Sequences include arrays and iterators but not strings. Arrays are all values that NumPy converts to an array of
numbers. The values themselves are checked by the functions.
"""

from __future__ import annotations

import functools
import inspect
import math
import os
import sys
import types
import typing
from collections import abc
from collections.abc import Callable
from numbers import Real
from reprlib import Repr
from typing import Any, NamedTuple, TypeVar, Union

import numpy as np
import numpy.typing

from fastcontact.arrays import MASKED_ENTRIES, is_masked
from fastcontact.errors import FastcontactError, nearest

F = TypeVar("F", bound=Callable[..., Any])
_ARRAY_LIKE = {*typing.get_args(np.typing.ArrayLike)}
_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60
_SCALAR_NAMES = {bool: "True or False", int: "a whole number", float: "a number"}


def typed(error: type[FastcontactError]) -> Callable[[F], F]:
    """Return a decorator of functions and classes that raises `error` for arguments that do not match their annotation.

    The constructor and the public methods of a class are checked.
    """

    def decorate(target: F) -> F:
        if not isinstance(target, type):
            return typing.cast(F, _checked(target, target.__qualname__, error))
        for name, method in [*vars(target).items()]:
            if isinstance(method, types.FunctionType) and (name == "__init__" or not name.startswith("_")):
                setattr(target, name, _checked(method, f"{target.__name__}.{name}", error))
        return target

    return decorate


def unchecked(function: F) -> F:
    """Return the function that `typed` has decorated, for calls within the package, whose arguments need no check."""
    return typing.cast(F, inspect.unwrap(function))


def _checked(function: Callable[..., Any], name: str, error: type[FastcontactError]) -> Callable[..., Any]:
    """Return a function that checks its arguments and then calls `function`; error messages call it `name`."""

    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        signature = _signature(function)
        try:
            values, annotations = signature.bind(*args, **kwargs).arguments, types_of(function)
        except TypeError:
            raise _argument_error(function, signature, _public_name(function, name, args), args, kwargs) from None
        for key, value in values.items():
            parameter = signature.parameters[key]
            annotation = annotations.get(key, Any)
            if parameter.kind is parameter.VAR_KEYWORD:
                members = {**value}
                annotation = Any if typing.get_origin(annotation) is typing.Unpack else annotation
            elif parameter.kind is parameter.VAR_POSITIONAL:
                members = {f"{key}[{i}]": member for i, member in enumerate(value)}
            elif value is parameter.default:
                continue
            else:
                members = {key: value}
            for argument, member in members.items():
                if is_masked(member) or not fits(member, annotation):
                    called = _public_name(function, name, args)
                    check_type(f"the argument {argument} of {called}", member, annotation, error)
        return function(*args, **kwargs)

    if any(str(annotation).startswith("Unpack[") for annotation in function.__annotations__.values()):
        wrapper.__signature__ = _help_signature(_signature(function), function)  # type: ignore[attr-defined]
    return wrapper


_signature = functools.cache(inspect.signature)


# First components of a load, a support or an initial state, by the name of the parameter that collects them.
COMPONENTS = {"components": ["x", "y"], "tensor_components": ["xx", "yy"], "moments": ["z"]}
# Beginnings of messages about arguments with components by axis.
VECTOR_ARGUMENTS = ("the argument motion ", "the argument force ")


def _argument_error(
    function: Callable[..., Any], signature: inspect.Signature, public_name: str, args: tuple[Any, ...],
    kwargs: dict[str, Any],
) -> TypeError:  # fmt: skip
    """Return Python's error for missing, unknown and misplaced arguments, in which the function is called `public_name`.

    For an unknown argument, the message suggests similar ones.
    """
    parameters = signature.parameters.values()
    positional = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    keywords = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]
    if len(args) > len(positional) and keywords:
        required = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.default is p.empty]
        components = next((COMPONENTS.get(p.name, []) for p in parameters if p.kind is p.VAR_KEYWORD), [])
        example = ", ".join(f"{key}=..." for key in (required or components or keywords)[:3])
        names = ", ".join([p.name for p in positional if p.name != "self"]) or "nothing"
        return TypeError(f"{public_name} takes {names} by position and all other arguments by keyword: write {example}")
    try:
        function(*args, **kwargs)
    except TypeError as failure:
        text = str(failure).replace(f"{function.__qualname__}()", f"{public_name}()", 1)
        missing = [key for key in signature.parameters if f"'{key}'" in text]
        suggestions = {key: nearest(key, missing) for key in kwargs if key not in signature.parameters}
        corrections = [f"{similar[0]} instead of {key}" for key, similar in suggestions.items() if similar]
        text += f": write {' and '.join(corrections)}" * bool(corrections)
        if unknown_key := text.partition("unexpected keyword argument '")[2].partition("'")[0]:
            text = text.partition(". Did you mean")[0]  # Python 3.13 suggests a name, too
            valid = [key for key in signature.parameters if key != "self"]
            similar = " or ".join(map(repr, nearest(unknown_key, valid)))
            text += f": did you mean {similar}?" if similar else f": expected one of {', '.join(valid)}"
        return TypeError(text)
    raise AssertionError(public_name)


def _help_signature(signature: inspect.Signature, function: Callable[..., Any]) -> inspect.Signature:
    """Return the signature for `help`, in which the keys of an unpacked `TypedDict` are keyword arguments."""
    parameters = list(signature.parameters.values())
    (keys,) = typing.get_args(types_of(function)[parameters[-1].name])
    kind = inspect.Parameter.KEYWORD_ONLY
    named = [
        inspect.Parameter(key, kind, default=None, annotation=getattr(text, "__forward_arg__", text))
        for key, text in keys.__annotations__.items()
    ]
    return signature.replace(parameters=[*parameters[:-1], *named])


def _public_name(function: Callable[..., Any], name: str, args: tuple[Any, ...]) -> str:
    """Return the name of a function or a method in messages: for a constructor that of the class."""
    owner, _, method = name.rpartition(".")
    if function.__name__ == "__init__" and args:
        return type(args[0]).__name__
    return f"{type(args[0]).__name__}.{method}" if owner and args else name


def check_fields(owner: str, values: abc.Mapping[str, Any], kind: type, error: type[FastcontactError]) -> None:
    """Raise `error` if a value does not have the type of the field of the same name in the class `kind`.

    `owner` is the name of the object in the message.
    """
    annotations = {name: annotation for base in reversed(kind.__mro__) for name, annotation in types_of(base).items()}
    for name, value in values.items():
        check_type(f"{name} of {owner}", value, annotations.get(name, Any), error)


@functools.cache
def types_of(target: Callable[..., Any]) -> dict[str, Any]:
    """Return the types of the arguments of a function, or of the fields of a class, by name."""
    annotations: dict[str, Any] = {}
    namespace = vars(sys.modules[target.__module__])
    for name, text in inspect.get_annotations(target).items():
        try:
            annotations |= typing.get_type_hints(types.SimpleNamespace(__annotations__={name: text}), namespace)
        except (NameError, TypeError):  # a name that only type checkers import, or an annotation that is not a type
            continue
    return annotations


def check_type(name_shown: str, value: Any, annotation: Any, error: type[FastcontactError]) -> None:
    """Raise `error` if a value does not have the annotated type or is masked; the message calls it `name_shown`."""
    if is_masked(value):
        raise error(f"{name_shown} {MASKED_ENTRIES}")
    if fits(value, annotation):
        return
    description = f"an object of the class {type(value).__name__}"
    if value is None:
        description = "None"
    elif isinstance(value, str | bytes):
        description = f"the string {_SHORT.repr(value)}"
    elif isinstance(value, bool | Real | complex | list | tuple | dict | set):
        description = f"the {type(value).__name__} {_SHORT.repr(value)}"
    elif isinstance(value, type):
        description = f"the class {value.__name__}"
    elif isinstance(value, np.ndarray):
        description = f"an array of shape {value.shape}"
    remedy = ""
    if isinstance(value, str) and _is_number(value) and fits(1, annotation):
        remedy = f": write {value.strip()} without quotation marks"
    elif isinstance(value, list | tuple) and value and name_shown.startswith(VECTOR_ARGUMENTS) and fits({}, annotation):
        remedy = f": write {dict(zip('xyz', value, strict=False))}"
    raise error(f"{name_shown} must be {type_name(annotation)}, not {description}{remedy}")


def _is_number(text: str) -> bool:
    """Return whether a text represents a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def values_at(function: Callable[..., Any], points: Any, name: str, error: type[FastcontactError]) -> Any:
    """Return the values of a user's function at `points`; if it fails, raise `error` with `name` in the message."""
    try:
        result = function(points)
    except Exception as failure:
        reason = f"{type(failure).__name__}: {failure}"
        raise error(
            f"{name} is a function that failed for {len(points)} points of shape {np.shape(points)} ({reason}): call it with "
            "such an array to see where"
        ) from failure
    if is_masked(result):
        raise error(f"{name} is a function whose result {MASKED_ENTRIES}")
    return result


class TypeTest(NamedTuple):
    """Test of values for an annotated type, which does not consume iterators, and the name of the type in messages."""

    fits: Callable[[Any], bool]
    name: str


def fits(value: Any, annotation: Any) -> bool:
    """Return whether a value has the annotated type; the members of iterators are not tested."""
    return type_test(annotation).fits(value)


def type_name(annotation: Any) -> str:
    """Return the name of an annotated type in messages, such as "a number or a function"."""
    return type_test(annotation).name


@functools.cache
def type_test(annotation: Any) -> TypeTest:
    """Return the test and the name of an annotated type."""
    origin, members = typing.get_origin(annotation) or annotation, typing.get_args(annotation)
    if annotation == np.typing.ArrayLike or origin is np.ndarray:
        return TypeTest(_is_array_like, "an array of numbers")
    if origin in (Union, types.UnionType):
        return _union_test(members)
    if annotation in (None, type(None)):
        return TypeTest(lambda value: value is None, "None")
    if annotation in _SCALAR_NAMES:
        return TypeTest(lambda value: _is_scalar(value, annotation), _SCALAR_NAMES[annotation])
    if origin in (tuple, list, abc.Sequence, abc.Iterable, abc.Collection):
        return _sequence_test(origin, members)
    if origin in (abc.Mapping, dict):
        return _mapping_test(members)
    names = {str: "string", os.PathLike: "path", abc.Callable: "function"}
    name = str(names.get(origin) or getattr(origin, "__name__", origin))
    return TypeTest(_simple_test(annotation, origin, members), f"{'an' if name[0] in 'AEIOU' else 'a'} {name}")


def _simple_test(annotation: Any, origin: Any, members: tuple[Any, ...]) -> Callable[[Any], bool]:
    """Return the test of a type without member types."""
    if origin is typing.Literal:
        are_strings = all(isinstance(member, str) for member in members)  # functions check the values of strings
        return lambda value: isinstance(value, str) if are_strings else value in members
    if origin is os.PathLike:
        return lambda value: isinstance(value, os.PathLike) and isinstance(os.fspath(value), str)
    if origin is abc.Callable:
        return callable
    if getattr(origin, "_is_protocol", False):
        names = [name for name in (*vars(origin), *inspect.get_annotations(origin)) if not name.startswith("_")]
        return lambda value: all(hasattr(value, name) for name in names) and not isinstance(value, type)
    if annotation in (Any, inspect.Parameter.empty) or not isinstance(origin, type):
        return lambda value: True
    return lambda value: isinstance(value, origin)


def _union_test(members: tuple[Any, ...]) -> TypeTest:
    """Return the test and the name of a union, in which None comes last."""
    if {*members} >= _ARRAY_LIKE:  # ArrayLike is itself a union
        members = (np.typing.ArrayLike, *(member for member in members if member not in _ARRAY_LIKE))
    tests = [type_test(member) for member in members]
    phrases = sorted(dict.fromkeys(test.name for test in tests), key="None".__eq__)
    return TypeTest(lambda value: any(test.fits(value) for test in tests), " or ".join(phrases))


def _sequence_test(origin: Any, members: tuple[Any, ...]) -> TypeTest:
    """Return the test and the name of a sequence. In an array only the first member is tested, in an iterator no member."""
    tests = [type_test(member) for member in members if member is not ...]
    if origin is tuple and members and members[-1] is not ...:
        count = {2: "two", 3: "three"}.get(len(members), str(len(members)))
        phrase = f"{count} numbers" if {*members} <= {int, float} else f"a sequence of {count}"
        return TypeTest(lambda value: _is_sequence(value) and hasattr(value, "__len__") and len(value) == len(tests)
                    and all(test.fits(member) for test, member in zip(tests, value)), phrase)  # fmt: skip

    def fits(value: Any) -> bool:
        if not tests or not isinstance(value, list | tuple | set | frozenset | np.ndarray):
            return _is_sequence(value)
        return _is_sequence(value) and all(map(tests[0].fits, value[:1] if isinstance(value, np.ndarray) else value))

    return TypeTest(fits, "a sequence" + (f" of {_plural(tests[0].name)}" if tests else ""))


def _mapping_test(members: tuple[Any, ...]) -> TypeTest:
    """Return the test and the name of a mapping."""
    if not members:
        return TypeTest(lambda value: isinstance(value, abc.Mapping), "a dictionary")
    keys, values = map(type_test, members)
    of_values = f" of {_plural(values.name)}" if members[1] is not Any else ""
    return TypeTest(lambda value: isinstance(value, abc.Mapping) and all(map(keys.fits, value))
                and all(map(values.fits, value.values())), f"a dictionary{of_values} by name")  # fmt: skip


def _is_scalar(value: Any, kind: type) -> bool:
    """Return whether a value is acceptable as a Boolean, an integer or a number, according to `kind`."""
    if isinstance(value, np.ndarray) and value.shape == () and value.dtype.kind in "iuf":
        return True
    is_boolean = isinstance(value, bool | np.bool_)
    if kind is bool:
        return is_boolean or (isinstance(value, Real) and value in (0, 1))
    try:
        return isinstance(value, Real) and not is_boolean and (math.isfinite(value) or kind is float)
    except OverflowError:  # an integer with hundreds of digits
        return False


def _is_array_like(value: Any) -> bool:
    """Return whether NumPy converts a value to an array of numbers."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "biufV"  # V: a structured array
    if value is None or isinstance(value, str | bytes | abc.Mapping):
        return False
    try:
        return np.asarray(value).dtype.kind in "biuf"
    except (TypeError, ValueError):
        return False


def _is_sequence(value: Any) -> bool:
    """Return whether a value is an array or another iterable, but not a string or a mapping."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, abc.Iterable) and not isinstance(value, str | bytes | abc.Mapping)


def _plural(phrase: str) -> str:
    """Return the plural of the name of a type, such as "numbers or functions" for "a number or a function"."""
    if phrase.endswith(" numbers") and not phrase.startswith("a "):
        return f"groups of {phrase}"
    if phrase.startswith("a sequence of"):
        return phrase.removeprefix("a ").replace("sequence", "sequences", 1)
    return " or ".join(
        name.removeprefix("a ").removeprefix("an ") + "s" * name.startswith(("a ", "an "))
        for name in phrase.split(" or ")
    )


def finite_vector(values: Any, size: int) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Return `values` as an array of `size` finite numbers, or None if they are not such an array."""
    try:
        vector = np.asarray(values, float)
    except (TypeError, ValueError):
        return None
    return vector if vector.shape == (size,) and np.isfinite(vector).all() else None


def unit_vector(
    kind: str, values: Any, owner: str, size: int, error: type[FastcontactError]
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the unit vector (size,) along `values`, or raise `error`; messages call it the `kind` of its `owner`."""
    vector = finite_vector(values, size)
    length = 0.0 if vector is None else float(np.linalg.norm(vector))
    if vector is None or not 0.0 < length < math.inf:
        raise error(f"the {kind} {values} of {owner} must be {size} numbers, not all zero")
    return np.asarray(vector / length)


def number_pairs(rows: Any) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """Return pairs of numbers as an array (n, 2), or None if `rows` are not pairs of numbers."""
    try:
        return np.array([[float(value) for value in row] for row in rows]).reshape(-1, 2)
    except (TypeError, ValueError, OverflowError):
        return None
