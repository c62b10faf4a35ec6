/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All parameters of a drive, of a file, or of the vendor's delivery state, and how two sets differ.
 * Files and the order of writing are the server's. Pure.
 *
 * A set is { name, family, identity, registers, values, missing }: registers as the service
 * describes them, values by name, missing the names that the drive should have reported.
 */

export const DEFAULTS = "default";

export function hasTrait(register, trait) {
	return (register.traits ?? []).includes(trait);
}

/* True for a parameter that a file can have: a value that the drive itself holds and may report. */
export function isKept(register) {
	return (
		register.parameter &&
		!["derived", "action", "secret"].some((trait) => hasTrait(register, trait))
	);
}

/* A number, or null when the set does not have it. */
export function valueOf(set, name) {
	const value = set.values[name];

	return typeof value === "number" ? value : null;
}

/* The vendor's delivery state for drives of the same family, as far as its documents give it. */
export function takeDefaults(like) {
	const values = {};

	for (const register of like.registers) {
		if (typeof register.default === "number")
			values[register.name] = register.default;
	}
	return { ...like, name: DEFAULTS, identity: "", values, missing: [] };
}

/* True if both have the same value of a register, or both none. */
export function agree(one, other, register) {
	const value = valueOf(one, register.name);
	const beside = valueOf(other, register.name);

	if (value === null || beside === null)
		return value === beside;
	/* Fractions have single precision in the drive. */
	return register.type === "f32"
		? Math.fround(value) === Math.fround(beside)
		: value === beside;
}

/*
 * The registers in which two sets differ. A value in only one of them differs, except where its
 * default is unknown.
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
