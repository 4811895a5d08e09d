"""Read a file like a user, and judge the outcome."""

import warnings
from pathlib import Path

import numpy as np

import fastcontact as fc
from fastcontact.cases.case import read_case

FIELDS = ("DEPL", "SIEF_NOEU", "PRES_CONT")
# What HDF5 says where it could not get the memory it wanted for values. It also asks for room for its own blocks, of a
# size that stands in the file, and gives up where that is absurd: nothing of it is ever used, so that is no failure.
NO_MEMORY = ("memory allocation failed", "unable to allocate", "can't allocate", "out of memory", "Unable to allocate")
OF_ITS_OWN = "for on disk image buffer"


def read(path: Path) -> None:
    """Read everything in a file, and check that it hangs together."""
    if path.suffix == ".toml":
        check_mesh(read_case(path).mesh)
    elif path.suffix == ".deck":
        check_deck(fc.read_deck(path))
    elif path.suffix == ".vtkhdf":
        read_results(path)
    else:
        check_mesh(fc.read_mesh(path))
        if path.suffix == ".rmed":
            for name in FIELDS:
                times, values = fc.read_med_field(path, name)
                assert values.ndim == 3
                assert len(times) == len(values)


def check_deck(deck: fc.Deck) -> None:
    """Check that a deck is a model with steps."""
    check_mesh(deck.model.mesh)
    assert len(deck.ramp)
    assert isinstance(deck.title, str)
    assert all(isinstance(note, str) for note in deck.notes)
    deck.model.describe()


def read_results(path: Path) -> None:
    """Read all steps of a result file."""
    with fc.open_results(path) as results:
        mesh = results.mesh
        check_mesh(mesh)
        assert isinstance(results.kinematics, str)
        assert isinstance(results.case_text, str)
        assert results.load_factors.shape == (len(results),)
        repr(results)
        for step in results:
            assert step.displacement.shape == step.reaction.shape == mesh.points.shape
            assert step.stress.shape == (mesh.n_points, 4 if mesh.dim == 2 else 6)
            assert step.von_mises.shape == step.von_mises_signed.shape == (mesh.n_points,)
            for contact in step.contact.values():
                assert contact.force.shape == (mesh.dim,)
                for name in ("coordinates", "force_vectors", "normal", "shear"):
                    assert getattr(contact, name).shape == (len(contact.points), mesh.dim)
                assert contact.pressure.shape == contact.active.shape == contact.points.shape
                mesh.points[contact.points]  # numbers of points that are there


def check_mesh(mesh: fc.Mesh) -> None:
    """Check that a mesh is one."""
    assert np.isfinite(mesh.points).all()
    assert mesh.n_cells
    for block in mesh.cells.values():
        assert block.min() >= 0
        assert block.max() < mesh.n_points
    for name in mesh.group_names:
        assert isinstance(name, str)
        mesh.points_of(name)


def outcome(path: Path) -> tuple[str, str]:
    """Read a file; return the kind of what happened, and the message.

    Good are ``"read"`` and ``"refused"``; bad are ``"other error"``, ``"memory"`` and ``"many lines"``.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)
    except fc.FastcontactError as error:
        message = str(error)
        if "\n" in message.strip("\n") or not message.strip() or len(message) > 2000:
            return "many lines", message
        return "memory" if _wanted_memory(error) else "refused", message
    except BaseException as error:
        return "memory" if _wanted_memory(error) else "other error", f"{type(error).__name__}: {error}"
    return "read", ""


def _wanted_memory(error: BaseException | None) -> bool:
    while error is not None:
        wanted = any(words in str(error) for words in NO_MEMORY) and OF_ITS_OWN not in str(error)
        if isinstance(error, MemoryError) or wanted:
            return True
        error = error.__cause__ or error.__context__
    return False
