/* SPDX-License-Identifier: Apache-2.0 */
/* Saving and opening files. */
import { element } from "./dom.js";

/* As a download; parts are texts or bytes. */
export function saveFile(name, parts, type = "text/plain;charset=utf-8") {
	const address = URL.createObjectURL(new Blob(parts, { type }));

	element("a", {
		href: address,
		download: name.replace(/[/\\:*?"<>|\0-\x1f]/g, "_")
	}).click();
	/* After the browser has started the download. */
	setTimeout(() => URL.revokeObjectURL(address), 60000);
}

let handed = null;

/* Gives a file to the view of a drive's parameters, which takes it when it is shown. */
export function handOver(drive, file) { handed = { drive, file }; }

/* The file for this drive, once; null: there is none. */
export function takeHanded(drive) {
	const file = handed?.drive === drive ? handed.file : null;

	handed = null;
	return file;
}

/* "20261122-162002", for names of files. */
export function nameTime(date = new Date()) {
	return new Date(date.getTime() - date.getTimezoneOffset() * 60000)
		.toISOString()
		.replace(/\..*|[-:]/g, "")
		.replace("T", "-");
}
