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
    request = json.loads(line)
    try:
        answer = {"result": ask(request["word"], request["job"], request["more"])}
    except Exception as error:  # noqa: BLE001 - every error is reported to the soak
        answer = {"wrong": str(error)}
    print(json.dumps(answer), flush=True)
