/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Texts in the form of drivebridgectl, for files that it and others read. Pure, but for the time
 * zone.
 */

/* Without control characters, which would have an effect in a text file or on a terminal. */
export function cleanText(text) {
	return String(text ?? "").replace(/[\0-\x1f\x7f-\x9f]/g, "?");
}

function pad(number, digits = 2) {
	return String(number).padStart(digits, "0");
}

/* Local time of day, "16:20:02.113", from microseconds since 1970, with 3 or 6 decimals. */
export function writeClock(timeUs, decimals) {
	const date = new Date(timeUs / 1000);

	return (
		`${pad(date.getHours())}:${pad(date.getMinutes())}:${pad(date.getSeconds())}.` +
		pad(timeUs % 1000000, 6).slice(0, decimals)
	);
}

/* "2026-11-22" */
export function writeDay(timeUs) {
	const date = new Date(timeUs / 1000);

	return `${date.getFullYear()}-${pad(date.getMonth() + 1)}-${pad(date.getDate())}`;
}

/* "+0100" */
export function writeZone(timeUs) {
	const minutes = -new Date(timeUs / 1000).getTimezoneOffset();

	return (
		(minutes < 0 ? "-" : "+") +
		pad(Math.floor(Math.abs(minutes) / 60)) +
		pad(Math.abs(minutes) % 60)
	);
}

/* A field of CSV. */
export function writeField(value) {
	if (value === null || value === undefined)
		return "";
	if (typeof value === "boolean")
		return value ? "1" : "0";
	if (typeof value === "number")
		return String(Number.isInteger(value) ? value : Number(value.toPrecision(9)));
	return /[,"\r\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value;
}
