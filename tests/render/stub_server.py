"""Stands in for the Blender process: answers, fails, hangs or dies as it is told."""

from __future__ import annotations

import json
import sys
import time


def main() -> None:
    """One JSON answer for each JSON request."""
    for line in sys.stdin:
        wish = json.loads(line)["do"]
        if wish == "die":
            print("out of memory", file=sys.stderr, flush=True)
            sys.exit(3)
        if wish == "sleep":
            time.sleep(60)
        answer = {"error": "no such room"} if wish == "fail" else {"ok": {"pid": 1}}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
