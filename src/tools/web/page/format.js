/* SPDX-License-Identifier: Apache-2.0 */
import { numbers as ofPage } from "./numbers.js";
import { t } from "./words.js";
/*
 * Values in words and words into values, by the service's description of a register: type, unit,
 * range, codes.
 *
 * Pure.
 */

export const NONE = "–";
/* The value of age_ms for a drive that was never read. */
const NEVER = 0xffffffff;
const MINUS = "−";

/* A Map of registers by name, for the other functions. */
export function indexByName(list) { return new Map(list.map((entry) => [entry.name, entry])); }

/* "move_absolute" for people: "move absolute", or as their language has it. */
export function inWords(name) { return t(String(name ?? "").replaceAll("_", " ")); }

/* As a label: "Move absolute". */
export function asLabel(name) {
	const words = inWords(name);

	return words.charAt(0).toUpperCase() + words.slice(1);
}

/* The name of a register next to its unit: "Watchdog" for watchdog_ms, which is shown in ms. */
export function labelOf(register) {
	return asLabel(register.unit ? register.name.replace(new RegExp(`_${register.unit}$`), "") :
		register.name);
}

export function hasBits(register) { return register?.type?.startsWith("bits") ?? false; }

/* The name of a code, or "" when it has none. */
export function codeName(register, value) {
	return (Number.isInteger(value) && !hasBits(register) && register?.codes?.[value]) || "";
}

/* The names of the set bits; "bit 3" for one without a name. */
export function bitNames(register, value) {
	const names = [];
	let rest = BigInt(Math.trunc(value ?? 0));

	for (let bit = 0; rest > 0n && bit < 64; bit++, rest >>= 1n) {
		if (rest & 1n)
			names.push(register?.codes?.[bit] ?? t("bit {bit}", { bit }));
	}
	return names;
}

export function hasBit(register, value, name) { return bitNames(register, value).includes(name); }

function isReal(register) { return register?.type === "f32"; }

/* As few digits as distinguish it from its neighbours: registers hold single precision. */
export function formatReal(value) {
	for (let digits = 6; digits <= 9; digits++) {
		const text = value.toPrecision(digits);

		if (Math.fround(Number(text)) === Math.fround(value))
			return showNumber(String(Number(text)));
	}
	return showNumber(String(value));
}

/* The shortest number that means the same count: 90.000056 deg is 90, where a count is 0.0001125 deg. */
export function formatFine(value, step) {
	for (let decimals = 0; decimals < 9; decimals++) {
		const rounded = Number(value.toFixed(decimals));

		if (Math.abs(rounded - value) < step / 2)
			return formatReal(rounded);
	}
	return formatReal(value);
}

/* The text of a number, in the language of the page. */
function showNumber(text) { return ofPage.write(text.startsWith("-") ? MINUS + text.slice(1) : text); }

/* Always with this number of decimals, so that a changing value does not move its neighbours. */
export function formatFixed(value, decimals) {
	if (typeof value !== "number" || !Number.isFinite(value))
		return NONE;
	const text = value.toFixed(decimals);

	/* A value that rounds to 0 has no sign. */
	return showNumber(Number(text) === 0 ? text.replace("-", "") : text);
}

/* With this number of digits at most. */
export function formatShort(value, digits) { return showNumber(String(Number(value.toPrecision(digits)))); }

/* The unit of a register by its name, in a Map of them; "" while it is unknown. */
export function lookUpUnit(registers, name) { return registers?.get(name)?.unit ?? ""; }

/* A value as { text, unit }; unit is "" if a name replaces the value. */
export function formatValue(register, value) {
	if (value === null || value === undefined)
		return { text: NONE, unit: "" };
	if (typeof value === "boolean")
		return { text: value ? t("on") : t("off"), unit: "" };
	if (typeof value === "string")
		return { text: value, unit: "" };
	if (hasBits(register))
		return {
			text: bitNames(register, value).map(inWords).join(", ") || t("none"),
			unit: ""
		};
	const name = codeName(register, value);

	if (name)
		return { text: inWords(name), unit: "" };
	if (register?.name === "age_ms")
		return { text: formatAge(value), unit: "" };
	return {
		text: isReal(register) ? formatReal(value) : showNumber(String(value)),
		unit: register?.unit ?? ""
	};
}

/* The same as one text: "3200 counts". */
export function formatWithUnit(register, value) {
	const { text, unit } = formatValue(register, value);

	return unit ? `${text} ${unit}` : text;
}

/* In milliseconds; "never" for a drive that was never read. */
export function formatAge(ms) {
	if (typeof ms !== "number" || ms >= NEVER)
		return t("never");
	if (ms < 1000)
		return `${Math.round(ms)} ms`;
	if (ms < 10000)
		return `${formatFixed(ms / 1000, 1)} s`;
	return formatSpan(ms / 1000);
}

/* "95 s", "12 min", "3 h", "4 d" */
export function formatSpan(seconds) {
	if (seconds < 120)
		return `${Math.floor(seconds)} s`;
	if (seconds < 7200)
		return `${Math.floor(seconds / 60)} min`;
	if (seconds < 172800)
		return `${Math.floor(seconds / 3600)} h`;
	return `${Math.floor(seconds / 86400)} d`;
}

function pad(value, digits = 2) { return String(value).padStart(digits, "0"); }

/* Microseconds since 1970 as local time: "16:20:02.113", with the day when it is not that of
 * `now`. */
export function formatTime(time_us, now = new Date()) {
	if (!time_us)
		return NONE;
	const date = new Date(time_us / 1000);
	const time =
		`${pad(date.getHours())}:${pad(date.getMinutes())}:${pad(date.getSeconds())}.` +
		pad(date.getMilliseconds(), 3);

	if (date.toDateString() === now.toDateString())
		return time;
	return `${date.getFullYear()}-${pad(date.getMonth() + 1)}-${pad(date.getDate())} ${time}`;
}

/* "since 16:20:02, for 3 min"; microseconds since 1970, and the present time in milliseconds. */
export function formatSince(since_us, now) {
	if (!since_us)
		return "";
	const [time] = formatTime(since_us, new Date(now)).split(/\.\d+$/);

	return t("since {time}, for {span}", { time, span: formatSpan(Math.max(0, now / 1000 - since_us / 1e6)) });
}

/* Microseconds: "4.2 ms" */
export function formatDuration(us) {
	if (typeof us !== "number")
		return NONE;
	if (us < 1000)
		return `${us} us`;
	if (us < 1000000)
		return `${formatFixed(us / 1000, 1)} ms`;
	return `${formatFixed(us / 1000000, 2)} s`;
}

/* bit/s: "115200 bit/s", "500 kbit/s", "1 Mbit/s" */
export function formatSpeed(speed) {
	if (speed >= 1000000 && speed % 100000 === 0)
		return `${showNumber(String(speed / 1000000))} Mbit/s`;
	return speed >= 10000 && speed % 1000 === 0 ? `${speed / 1000} kbit/s` : `${speed} bit/s`;
}

/* "192.168.10.5" for a number with the first byte highest. */
export function formatAddress(number) {
	return [24, 16, 8, 0].map((shift) => (number >>> shift) & 255).join(".");
}

/*
 * Conversion between a drive's counts and user units. Registers in counts, counts/s and so on are
 * shown and typed in the drive's unit_name if it and counts per unit are known; all others stay as
 * they are.
 */
export function createScale(unitName, countsPerUnit) {
	const usable = unitName && Number.isFinite(countsPerUnit) && countsPerUnit !== 0;
	const per = (register) =>
		(usable && /^counts(\/|$)/.test(register?.unit ?? "") ? countsPerUnit : 1);
	const digits = usable ? Math.ceil(Math.log10(Math.abs(countsPerUnit))) : 0;
	const fine = Math.min(6, Math.max(0, digits));

	return {
		unit: (register) => (per(register) === 1 ? register?.unit ?? "" :
			unitName + register.unit.slice("counts".length)),
		/* In user units. */
		show: (register, value) =>
			(typeof value === "number" ? value / per(register) : value),
		/* In the register's own unit; whole if it takes only integers. */
		take(register, value) {
			if (per(register) === 1)
				return value;
			return isReal(register) ? value * countsPerUnit : Math.round(value * countsPerUnit);
		},
		/* Enough decimals to distinguish two counts. */
		decimals(register) {
			if (per(register) === 1)
				return isReal(register) ? 2 : 0;
			return register.unit === "counts" ? fine : Math.min(fine, 2);
		},
		isScaled: (register) => per(register) !== 1,
		/* One count in user units; 0: values are exact. */
		step: (register) => (per(register) === 1 ? 0 : Math.abs(1 / per(register))),
		/* The register for typing: with its range in user units it is no integer. */
		typed(register) {
			if (per(register) === 1)
				return { ...register, unit: register?.unit ?? "" };
			const [one, other] = [register.min, register.max].map((limit) =>
				(typeof limit === "number" ? limit / countsPerUnit : undefined));

			return {
				...register,
				type: "f32",
				unit: this.unit(register),
				min: countsPerUnit > 0 ? one : other,
				max: countsPerUnit > 0 ? other : one
			};
		},
	};
}

/* The range of a register: "−12800 to 12800 counts/s", "at most 5", "" without limits. */
export function formatRange(register) {
	const { min, max } = register ?? {};
	const unit = register?.unit ?? "";
	const [low, high] = [min, max].map((limit) => (typeof limit === "number" ?
		formatShort(limit, 10) : ""));
	let range = low ? t("at least {low}", { low }) : t("at most {high}", { high });

	if (!low && !high)
		return "";
	if (low && high)
		range = t("{low} to {high}", { low, high });
	return unit ? `${range} ${unit}` : range;
}

/*
 * Typed text as a value of this register: { value }, or { problem } in words. Accepts names of
 * codes and of bits (with commas between) as well as numbers, in the form of `numbers` (numbers.js) or with a point.
 */
export function parseValue(register, typed, numbers = ofPage) {
	const text = typed.trim().replace(MINUS, "-");
	const codes = Object.entries(register?.codes ?? {});
	const find = (name) => codes.find(([, called]) => inWords(called).toLowerCase() ===
			inWords(name).trim().toLowerCase());

	if (register?.type === "text")
		return { value: typed };
	if (text === "")
		return { problem: t("a value is missing") };
	if (register?.type === "bool") {
		const on = ["on", "true", "1", "yes", t("on")].includes(text.toLowerCase());

		return on || ["off", "false", "0", "no", t("off")].includes(text.toLowerCase()) ?
			{ value: on } :
			{ problem: t("“{text}” is neither on nor off", { text }) };
	}
	if (hasBits(register) && !/^\d|^0x/.test(text)) {
		let bits = 0n;

		for (const name of ["none", t("none")].includes(text) ? [] : text.split(",")) {
			const found = find(name);

			if (!found)
				return { problem: t("no bit is called “{name}”", { name: name.trim() }) };
			bits |= 1n << BigInt(found[0]);
		}
		return { value: Number(bits) };
	}
	const found = find(text);

	if (found)
		return { value: Number(found[0]) };
	return parseNumber(register, text, codes.length > 0, numbers);
}

function parseNumber(register, typed, named, numbers) {
	const { text, problem } = numbers.read(typed);

	if (problem)
		return { problem };
	const whole = !isReal(register);
	const form = whole ? /^(-?\d+|0x[0-9a-f]+)$/i : /^-?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;
	const value = form.test(text) ? Number(text) : NaN;
	const range = formatRange(register) || t("any");

	if (!Number.isFinite(value)) {
		const kind = whole ? t("whole number") : t("number");
		const names = named ? t(", or a name of its codes") : "";

		return { problem: t("“{text}” is no {kind}; right is {range}{names}", { text: typed, kind, range, names }) };
	}
	if ((typeof register?.min === "number" && value < register.min) ||
	    (typeof register?.max === "number" && value > register.max))
		return { problem: t("{text} is out of range, {range}", { text: showNumber(text), range }) };
	return { value };
}
