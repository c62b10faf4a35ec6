/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All parameters of a drive, of a file, or as the vendor delivers them: how two sets differ, and in
 * which order one becomes the other. As src/ctl/params_source.c. Pure.
 *
 * A set is { name, family, identity, registers, values, missing }: registers as the service
 * describes them, values by name, missing what the drive should have told.
 */

export const DEFAULTS = "default";

export function hasTrait(register, trait) {
	return (register.traits ?? []).includes(trait);
}

/* Whether a file can have it: a value that the drive itself holds and may tell. */
export function isKept(register) {
	return (
		register.parameter &&
		!["derived", "action", "secret"].some((trait) => hasTrait(register, trait))
	);
}

/* A number, or null when the set says nothing of it. */
export function valueOf(set, name) {
	const value = set.values[name];

	return typeof value === "number" ? value : null;
}

/* What the vendor delivers drives of the same family with, as far as its documents say. */
export function takeDefaults(like) {
	const values = {};

	for (const register of like.registers) {
		if (typeof register.default === "number")
			values[register.name] = register.default;
	}
	return { ...like, name: DEFAULTS, identity: "", values, missing: [] };
}

/* Whether both say the same of a register, or both nothing. */
export function agree(one, other, register) {
	const value = valueOf(one, register.name);
	const beside = valueOf(other, register.name);

	if (value === null || beside === null)
		return value === beside;
	/* What is not whole is of single precision in the drive. */
	return register.type === "f32"
		? Math.fround(value) === Math.fround(beside)
		: value === beside;
}

/*
 * The registers of which two sets say different things. What only one of them says differs, but for
 * what a default is not known of.
 */
export function compare(one, other) {
	const ofDefaults = one.name === DEFAULTS || other.name === DEFAULTS;

	return one.registers.filter(
		(register) =>
			isKept(register) &&
			!agree(one, other, register) &&
			!(
				ofDefaults &&
				(valueOf(one, register.name) === null ||
					valueOf(other, register.name) === null)
			)
	);
}

function rankOf(register) {
	return hasTrait(register, "address")
		? 3
		: hasTrait(register, "first")
			? 0
			: hasTrait(register, "last")
				? 2
				: 1;
}

/*
 * The order in which `names` are written: arrays of registers, each of what is written as one.
 * First what others rest upon, then what puts others to use, at last what says where the drive is
 * heard.
 */
export function planWrites(registers, names) {
	const plan = [];

	for (let rank = 0; rank <= 3; rank++) {
		let group = null; // the latest, while more may join it

		for (const register of registers) {
			const together = hasTrait(register, "together");

			if (!names.has(register.name) || rankOf(register) !== rank)
				continue;
			if (group && together) {
				group.push(register);
				continue;
			}
			plan.push([register]);
			group = together ? plan[plan.length - 1] : null;
		}
	}
	return plan;
}
