/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Parameters into a drive, one after the other, each read back: as src/ctl/params_restore.c does
 * it. No I/O of its own.
 */
import { formatWithUnit } from "./format.js";
import { agree, hasTrait } from "./parameter_set.js";

/*
 * Results after which nothing more can be written: the drive is gone, or belongs to somebody else.
 */
const GONE = ["offline", "bus_down", "timeout", "indeterminate", "not_in_control"];

/* Whether others may go where this one did not. */
function mayGoOn(error) {
	return (
		["Refused", "BadValue", "Busy"].includes(error.name) &&
		!GONE.includes(error.parameters?.result)
	);
}

/*
 * Carries out a plan of planWrites(). call(method, parameters) promises an answer or throws {
 * error, parameters, text }; report(register, state, text) hears of each parameter: writing, done,
 * failed, stopped (not tried any more). isEnded() says that whoever asked has had enough. Promises
 * { written, failed: Map name -> reason, over: "" or why }.
 */
export async function writeParametersInto(drive, plan, wanted, { call, report, isEnded }) {
	const written = [];
	const failed = new Map();
	let over = "";

	function fail(register, reason) {
		failed.set(register.name, reason);
		report(register, "failed", reason);
	}

	/* Only what the drive then has is reported as that. */
	async function readBack(registers, result) {
		const names = registers
			.filter((one) => !hasTrait(one, "secret"))
			.map((one) => one.name);
		let held = {};

		try {
			if (names.length > 0)
				held = (await call("Read", { drive, names })).values;
		} catch (error) {
			over = mayGoOn(error) ? "" : error.message;
		}
		for (const register of registers) {
			const value = held[register.name] ?? null;

			if (hasTrait(register, "secret")) {
				report(register, "done", `${result}; it cannot be read back`);
			} else if (value === null) {
				fail(register, "the drive does not tell it");
				continue;
			} else if (!agree({ values: held }, { values: wanted }, register)) {
				fail(
					register,
					`the drive shows ${formatWithUnit(register, value)}`
				);
				continue;
			} else {
				report(register, "done", result, value);
			}
			written.push(register.name);
			failed.delete(register.name);
		}
	}

	async function writeGroup(registers) {
		const values = {};
		let answer;

		for (const register of registers) {
			values[register.name] = wanted[register.name];
			report(register, "writing", "");
		}
		try {
			answer = await call("Write", { drive, values });
		} catch (error) {
			registers.forEach((register) => fail(register, error.message));
			over = mayGoOn(error) ? "" : error.message;
			return;
		}
		await readBack(registers, answer.result);
	}

	/*
	 * What a drive refuses because of another parameter it takes when that was written: so
	 * twice.
	 */
	for (const again of [false, true]) {
		if (again && written.length === 0)
			break;
		for (const registers of plan) {
			if (over || (again && !failed.has(registers[0].name)))
				continue;
			over = isEnded() ? "it was ended" : "";
			if (!over)
				await writeGroup(registers);
		}
	}
	for (const register of plan.flat()) {
		if (!written.includes(register.name) && !failed.has(register.name)) {
			failed.set(register.name, "not tried any more");
			report(register, "stopped", "not tried any more");
		}
	}
	return { written, failed, over };
}
