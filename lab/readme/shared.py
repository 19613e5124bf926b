"""What the scripts of this folder share: files of results, and programs."""
import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "lab/results"


def read(name):
    """The lines of a file of results."""
    return [json.loads(line) for line in (RESULTS / name).read_text().splitlines()]


def write(name, lines):
    (RESULTS / name).write_text("".join(json.dumps(line) + "\n" for line in lines))


def run(*command, codes=(0,)):
    """What a program prints."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode not in codes:
        sys.exit(f"error: {' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout
