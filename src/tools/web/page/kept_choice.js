/* SPDX-License-Identifier: Apache-2.0 */
/* Choices that this browser keeps, if it stores anything at all. */

export function recall(name, otherwise) {
	try {
		return localStorage.getItem(name) ?? otherwise;
	} catch {
		return otherwise;
	}
}

export function remember(name, choice) {
	try {
		localStorage.setItem(name, choice);
	} catch {
		/* The browser stores nothing. */
	}
}
