"""Where the Python benchmarks find the sources and real volumes."""

import os
import pathlib

SOURCE = pathlib.Path(__file__).resolve().parent.parent


def data_folder():
    """Real volumes: $VOXLOOM_DATA, else ../shared/data beside the source folder; None without."""
    given = os.environ.get("VOXLOOM_DATA")
    folder = pathlib.Path(given) if given else SOURCE.parent / "shared" / "data"
    return folder if folder.is_dir() else None
