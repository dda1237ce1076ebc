"""What a soak asks of a farm by the Python module: a JSON line in, a JSON line out."""

import json
import sys

import bottega

farm = bottega.Farm(sys.argv[1])


def ask(word: str, job: int, more: dict) -> object:
    if word == "jobs":
        return [each.view() for each in farm.jobs()]
    if word == "machines":
        return farm.machines()
    if word == "submit":
        return farm.submit(bottega.Request.from_json(json.dumps(more))).number
    known = {each.number: each for each in farm.jobs()}[job]
    if word == "fetch":
        return str(known.fetch(more["path"]))
    getattr(known, word)()
    return None


print(json.dumps({"ready": True}), flush=True)
for line in sys.stdin:
    asked = json.loads(line)
    try:
        told = {"told": ask(asked["word"], asked["job"], asked["more"])}
    except Exception as error:  # noqa: BLE001 - whatever it is, the soak is told
        told = {"wrong": str(error)}
    print(json.dumps(told), flush=True)
