# SPDX-License-Identifier: Apache-2.0
"""Temperaments: what a vendor's document leaves open, and drives therefore do one way or another.

Each is a key of the simulator's configuration. test_temperaments_FAMILY.py lists a family's as
TEMPERAMENTS and runs the family's core behaviour under each of them, and under combinations;
docs/generate/temperaments-table writes docs/temperaments.md from the lists.

A long run has TEMPERAMENT_COMBINATIONS=200; TEMPERAMENT_SEED gives other combinations. TEMPERAMENT_ONLY names one
set, as name() does, and there is no other then. tests/temperaments sets them.
"""

import os
import random
from dataclasses import dataclass


@dataclass(frozen=True)
class Temperament:
    """One value of one open point.

    family   the protocol whose drives may be so, as the configuration names it
    key      of the simulator's configuration
    value    what the simulated drive is set to; the key's default is no temperament
    sees     one sentence for PLC users: what they notice of it
    section  where the simulator has the key: "bus" or "drive"
    bus, drive
             what has to be set in the bridge's configuration for such a drive, as pairs; most need
             nothing
    sim_bus, sim_drive
             what else the simulator has to be told, as pairs
    core     whether a PLC's commands work with it; where not, tests elsewhere show what it sees
    """

    family: str
    key: str
    value: object
    sees: str
    section: str = "drive"
    bus: tuple = ()
    drive: tuple = ()
    sim_bus: tuple = ()
    sim_drive: tuple = ()
    core: bool = True


def written(value):
    """As the simulator's configuration has it, but for quotes and braces."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return ",".join(str(item) for item in value)
    return str(value)


def name(temperaments):
    """Of a set of them, for the ids of tests."""
    return "+".join(f"{one.key}={written(one.value)}" for one in temperaments) or "plain"


def _merge(keys, pairs):
    """Two of a set may need the same key: the larger value serves both."""
    for key, value in pairs:
        old = keys.get(key)
        numbers = isinstance(old, (int, float)) and isinstance(value, (int, float))
        keys[key] = max(old, value) if numbers else value


def options(temperaments, **given):
    """What Bridge() is to be given for a drive with these temperaments, beside `given`. What they need goes before that."""
    needed = {key: {} for key in ("bus", "drive", "sim_bus", "sim_drive")}
    for one in temperaments:
        needed[f"sim_{one.section}"][one.key] = one.value
        for section, keys in needed.items():
            _merge(keys, getattr(one, section))
    return {**given, **{section: {**(given.get(section) or {}), **keys} for section, keys in needed.items()}}


def start(make_bridge, temperaments, **given):
    """The simulator and the bridge, online. `make_bridge` is the fixture; `given` as for Bridge."""
    return make_bridge(**options(temperaments, **given))


def combination_count():
    return int(os.environ.get("TEMPERAMENT_COMBINATIONS", "4"))


def combinations(temperaments, count=None, seed=None, agree=lambda chosen: True):
    """So many sets of two and more, of each key at most one value; the same seed gives the same
    sets. `agree` says whether a drive can be all of a set at once."""
    seed = os.environ.get("TEMPERAMENT_SEED", "1") if seed is None else seed
    by_key = {}
    for one in temperaments:
        by_key.setdefault(one.key, []).append(one)
    least = min(2, len(by_key))
    chance = random.Random(str(seed))
    sets = []
    while len(sets) < (combination_count() if count is None else count):
        chosen = tuple(chance.choice(values) for values in by_key.values() if chance.random() < 0.5)
        if len(chosen) >= least and agree(chosen):
            sets.append(chosen)
    return sets


def sets(temperaments, agree=lambda chosen: True):
    """What a family's tests run under: nothing, each one, and combinations; or what TEMPERAMENT_ONLY names."""
    temperaments = [one for one in temperaments if one.core]
    only = os.environ.get("TEMPERAMENT_ONLY")
    if only is None:
        return [(), *((one,) for one in temperaments), *combinations(temperaments, agree=agree)]
    known = {name([one]): one for one in temperaments}
    parts = [part for part in only.split("+") if part != "plain"]
    # Another family of the same file may not know it.
    return [tuple(known[part] for part in parts)] if known.keys() >= set(parts) else []
