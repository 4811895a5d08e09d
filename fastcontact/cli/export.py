"""``fastcontact export``: write results in the formats of other programs."""

from __future__ import annotations

from argparse import Namespace

from fastcontact.cli._outputs import check_outputs, say_written
from fastcontact.errors import CaseError

HELP = "export a result file: MED with fields (Salome, ParaVis) or an XDMF sidecar (old ParaView)"
ARGUMENTS = {
    "file": "result file (.vtkhdf)",
    "--med FILE": "write mesh and fields of all steps as MED",
    "--xdmf FILE": "write an XDMF file that refers to the result file",
}


def run(options: Namespace) -> int:
    """Write the requested files."""
    if not (options.med or options.xdmf):
        raise CaseError("nothing to export: give --med FILE or --xdmf FILE")
    check_outputs([options.file], [options.med, options.xdmf])
    if options.med:
        from fastcontact.results.med import write_med_results
        from fastcontact.results.reader import open_results

        with open_results(options.file) as results:
            write_med_results(options.med, results.mesh, results)
    if options.xdmf:
        from fastcontact.results.xdmf import write_xdmf

        write_xdmf(options.file, options.xdmf)
    say_written(options, options.med, options.xdmf)
    return 0
