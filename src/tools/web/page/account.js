/* SPDX-License-Identifier: Apache-2.0 */
/* The user's own name and rights, and another password for himself. */
import { changePassword, getSession } from "./api.js";
import { element, setText } from "./dom.js";

export const title = "Account";

const RIGHTS = [
	["look", "see drives, parameters, traces and events"],
	["stop", "stop any drive"],
	["move", "move drives"],
	["engineer", "change parameters, set an origin, commission"],
	["manage", "reload the configuration, scan, set addresses"],
	["appoint", "make users"],
	["audit", "read the audit trail"]
];

function createSecret(id, words, autocomplete) {
	const input = element("input", { id, type: "password", autocomplete, required: true });

	return { input, field: element("label", { class: "field", for: id }, words, input) };
}

function createForm(context, session) {
	const now = createSecret("password-now", "Password of now", "current-password");
	const fresh = createSecret(
		"password-fresh", `New password, ${session.password.least} characters or more`, "new-password");
	const again = createSecret("password-again", "The same again", "new-password");
	const problem = element("p", { id: "password-problem", class: "problem", role: "alert" });
	const button = element(
		"button", { id: "password-submit", class: "primary", type: "submit" }, "Change");
	const form = element("form", { id: "password", class: "panel login" },
		element("h2", {}, "Password"),
		session.password.weak ?
			element("p", { id: "password-weak", class: "problem" },
				`By today's rules yours is weak: ${session.password.weak}.`) :
			null,
		now.field, fresh.field, again.field, problem, button);

	form.addEventListener("submit", async (event) => {
		event.preventDefault();
		if (fresh.input.value !== again.input.value) {
			setText(problem, "These are two different passwords.");
			return;
		}
		button.disabled = true;
		setText(problem, "");
		try {
			await changePassword(now.input.value, fresh.input.value);
			context.notify("The password was changed. Other sessions of yours have ended.", "ok");
			context.showAgain();
		} catch (error) {
			setText(problem, error.message);
		}
		button.disabled = false;
	});
	return form;
}

export function show(root, context) {
	const session = getSession();
	const { user, role, drives, password } = session;

	if (!user) {
		root.append(element("p", { class: "empty" }, "Nobody is logged in."));
		return;
	}
	root.append(
		element("div", { class: "view-head" }, element("h1", {}, user)),
		element("section", { id: "rights", class: "panel", "aria-label": "Rights" },
			element("p", {}, `Role: ${role}. Drives: ${drives ? drives.join(", ") : "all"}.`),
			element("ul", {}, RIGHTS.map(([what, words]) => element(
				"li", { class: context.may(what) ? null : "muted" },
				context.may(what) ? words : `${words}: ${context.whyNot(what)}`)))),
		password.own ? createForm(context, session) :
			element("p", { class: "panel" }, "This password is not kept here: PAM checks it."));
}

export function hide() {}
