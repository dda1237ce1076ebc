"""Checks files of packaging/ by the schemas of those who read them: Kubernetes, Open Job Description, CycloneDX.

    check.py BILL.cdx.json

Needs kubernetes-validate, openjd-cli and cyclonedx-python-lib (its schemas): xtask/requirements.txt.
"""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import jsonschema
import kubernetes_validate
import yaml
from referencing import Registry, Resource

HERE = Path(__file__).resolve().parent


def check_kubernetes() -> int:
    count = 0
    for file in sorted((HERE / "kubernetes").glob("*.yaml")):
        for part in yaml.safe_load_all(file.read_text()):
            kubernetes_validate.validate(part, "1.37", strict=True)
            count += 1
    return count


def check_open_job_description() -> int:
    files = sorted((HERE / "openjd").glob("*.yaml"))
    for file in files:
        done = subprocess.run([sys.executable, "-m", "openjd", "check", str(file)], capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{file}: {done.stdout}{done.stderr}")
    return len(files)


def check_bill(file: Path) -> int:
    # Found, not imported: the rest of the library needs more packages.
    library = find_spec("cyclonedx")
    assert library and library.submodule_search_locations
    folder = Path(library.submodule_search_locations[0]) / "schema" / "_res"
    schemas = {path.name: json.loads(path.read_text()) for path in folder.glob("*.schema.json")}
    registry = Registry().with_resources(
        (schema.get("$id", name), Resource.from_contents(schema)) for name, schema in schemas.items()
    )
    bill = json.loads(file.read_text())
    jsonschema.Draft7Validator(schemas["bom-1.6.SNAPSHOT.schema.json"], registry=registry).validate(bill)
    return len(bill["components"])


if __name__ == "__main__":
    print(f"{check_kubernetes()} manifests of Kubernetes, {check_open_job_description()} templates of Open Job Description,", end=" ")
    print(f"{check_bill(Path(sys.argv[1]))} components of the bill of materials")
