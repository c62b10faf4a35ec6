/* SPDX-License-Identifier: Apache-2.0 */
import { t } from "./words.js";
/*
 * What is in a file of a gateway's state: made on the page, or by drivebridgectl backup, which has
 * root's files as well. Pure.
 */

/* The first line of the file `gateway`; drivebridgectl restore takes only its own. */
export const HEAD = "drivebridge-backup of the page 1";
const HEADS = [HEAD, "drivebridge-backup 1"];
const EDITED = "configuration/edited/edited.conf";

/* answer: of askGateway(); parameters: a Map of texts by drive. Returns a Map of texts by path. */
export function makeFiles({ version, configuration, users, certificates }, parameters) {
	const files = new Map([["gateway", `${HEAD}\n${version}\n`], [EDITED, configuration.text],
		["running.conf", configuration.running]]);

	if (users)
		files.set("configuration/access/users", users.map(({ user, role, drives }) =>
			`${user}:${role}:${drives}:\n`).join(""));
	files.set("certificates", certificates.map((name) => `${name}\n`).join(""));
	for (const [drive, text] of parameters)
		files.set(`parameters/${drive}.params`, text);
	return files;
}

/* The same read back: { edited (null: none), users, certificates, parameters, roots }; roots are the
 * files that only root can put in their places. */
export function readFiles(files) {
	const [head] = (files.get("gateway") ?? "").split("\n");
	const parameters = new Map();

	if (!HEADS.includes(head))
		throw new Error(t("it is no file of a gateway"));
	for (const [path, text] of files) {
		const [, drive] = /^parameters\/([^/]+)\.params$/.exec(path) ?? [];

		if (drive)
			parameters.set(drive, text);
	}
	return {
		edited: files.get(EDITED) ?? null,
		/* Passwords of another gateway, though hashed, are not looked at. */
		users: (files.get("configuration/access/users") ?? "").split("\n")
			.filter((line) => line && !line.startsWith("#")).map((line) => line.split(":"))
			.filter((parts) => parts.length >= 4)
			.map(([user, role, drives]) => ({ user, role, drives })),
		certificates: (files.get("certificates") ?? "").split("\n").filter(Boolean),
		parameters,
		roots: [...files.keys()].filter((path) => /^(configuration|opcua)\//.test(path) &&
			path !== EDITED && path !== "configuration/access/users")
	};
}

const DEVICE = /^(\s*device\s*=\s*"?)([^"\s#]+)/gm;

/* The ports that a text names, each once. */
export function listDevices(text) {
	return [...new Set([...text.matchAll(DEVICE)].map(([, , device]) => device))];
}

/* The text with other ports, a Map of new names by old ones. */
export function replaceDevices(text, others) {
	return text.replace(DEVICE, (whole, before, device) =>
		(others.get(device) ? before + others.get(device) : whole));
}
