# The config files, read by the project's own reader before Snakemake reads them for good: of a key
# that stands twice Snakemake takes the last, and what is no text or too deep ends in a traceback.

import os
import sys
from pathlib import Path

if os.name != "posix":
    sys.exit(
        "reobserve: the pipeline takes bash and a system like Linux; the library runs here, too"
    )

from reobserve.ledger.config import read_yaml
from reobserve.errors import ReobserveError
from reobserve.plain_data.json_data import read_json


def check_config_files(*own):
    """Refuse in one sentence what is no plain data, in these files and those of the call."""
    try:
        for path in map(Path, (*own, *workflow.configfiles)):
            read = read_json if path.suffix == ".json" else read_yaml
            read(path)
    except ReobserveError as error:
        sys.exit(f"reobserve: {error}")


check_config_files("config/config.yaml")
