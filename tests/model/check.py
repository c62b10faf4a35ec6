# SPDX-License-Identifier: Apache-2.0
"""The model check: histories of concurrent clients against the bridge, with the simulator as witness."""

import argparse
import json
import secrets
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from bridgelib import ROOT
from model import history as histories
from model.families import FAMILIES, shown
from model.judge import judge
from model.player import Player
from model.shrink import Shrinker

EPISODE = 250  # commands between a fresh start and the next
CASES = ROOT / "build" / "model"


def play(history):
    """Its record. The path of a UNIX socket must stay short."""
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        return Player(history, Path(directory)).run()


def faults_of(history):
    return judge(play(history))


def told(history, record, faults, count=12):
    """A failure in words: what broke, what the clients did, what the drive did."""
    lines = [f"{history.family}, seed {history.seed}: {len(faults)} broken rules"]
    lines += [f"  {fault.rule}: {fault.text}" for fault in faults[:count]]
    if len(history.steps) <= 60:
        lines += ["the history, with settings " + json.dumps(history.settings)]
        lines += [f"  {json.dumps(step)}" for step in history.packed()["steps"]]
    drive = next((fault.drive for fault in faults if fault.drive), None)
    events = [event for event in record.events if drive in (None, event.drive)]
    last = max((fault.time for fault in faults), default=0)
    events = [event for event in events if not last or event.time <= last + 0.5]
    lines += ["what the drive did"] + [f"  {line}" for line in shown(events)]
    return "\n".join(lines)


def save(history):
    CASES.mkdir(parents=True, exist_ok=True)
    path = CASES / f"{history.family}-{history.seed}.json"
    path.write_text(json.dumps(history.packed(), indent=1), encoding="utf-8")
    return path


def examine(family, seed, count, shrink_seconds=180, say=lambda text: None):
    """Plays the episode of this seed. None, or what broke: its shortest history and how to replay it."""
    history = histories.make(FAMILIES[family](), seed, count)
    record = play(history)
    faults = judge(record)
    if not faults:
        return None
    say(told(history, record, faults))
    shrinker = Shrinker(faults_of, history, faults[0], shrink_seconds, say)
    short = shrinker.run()
    record = play(short)
    again = judge(record)
    path = save(short)
    text = told(short, record, again or faults)
    return (f"{text}\n{len(history.steps)} steps shrunk to {len(short.steps)} in {shrinker.runs} "
            f"runs\nreplay: tests/model/run --replay {path.relative_to(ROOT)}\n"
            f"whole: tests/model/run --family {family} --episode {seed} --commands {count}")


def replay(path, times):
    history = histories.History.unpacked(json.loads(Path(path).read_text(encoding="utf-8")))
    failed = 0
    for _ in range(times):
        record = play(history)
        faults = judge(record)
        failed += bool(faults)
        print(told(history, record, faults) if faults else "held", flush=True)
    print(f"{failed} of {times} runs broke a rule")
    return failed


def run_episodes(jobs, work):
    failures = 0
    with ProcessPoolExecutor(jobs) as pool:
        for task, outcome in [(task, pool.submit(examine, *task)) for task in work]:
            text = outcome.result()
            failures += text is not None
            if text:
                print(text, flush=True)
            else:
                print(f"{task[0]} {task[1]}: {task[2]} commands, held", flush=True)
    return failures


def options():
    parser = argparse.ArgumentParser(prog="tests/model/run", description=__doc__)
    parser.add_argument("--family", choices=[*FAMILIES, "all"], default="all")
    parser.add_argument("--commands", type=int, default=1000, help="for each family (1000)")
    parser.add_argument("--seed", default=None, help="any text; a fresh one is made and printed")
    parser.add_argument("--episode", default=None, help="only the episode of this name, SEED.NUMBER")
    parser.add_argument("--jobs", type=int, default=1, help="episodes side by side (1)")
    parser.add_argument("--shrink-seconds", type=int, default=180)
    parser.add_argument("--replay", metavar="FILE", help="a history that was kept")
    parser.add_argument("--times", type=int, default=5, help="how often to replay it (5)")
    return parser.parse_args()


def main():
    args = options()
    if args.replay:
        return 1 if replay(args.replay, args.times) else 0
    seed = args.seed or secrets.token_hex(4)
    families = FAMILIES if args.family == "all" else [args.family]
    print(f"seed {seed}", flush=True)
    if args.episode:
        work = [(family, args.episode, args.commands, args.shrink_seconds) for family in families]
    else:
        count = -(-args.commands // EPISODE)
        work = [(family, f"{seed}.{number}", min(EPISODE, args.commands), args.shrink_seconds)
                for number in range(count) for family in families]
    failures = run_episodes(args.jobs, work)
    total = sum(task[2] for task in work)
    print(f"{total} commands in {len(work)} episodes, {failures} broke a rule")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
