/* SPDX-License-Identifier: Apache-2.0 */
import { logIn } from "./api.js";
import { element, setText } from "./dom.js";
import { t } from "./words.js";

export const title = t("Log in");

export function show(root) {
	const user = element("input", { id: "login-user", name: "user", type: "text", autocomplete: "username",
		autocapitalize: "none", spellcheck: "false", required: true });
	const password = element("input", { id: "login-password", name: "password", type: "password",
		autocomplete: "current-password", required: true });
	const problem = element("p", { id: "login-problem", class: "problem", role: "alert" });
	const button = element("button", { id: "login-submit", class: "primary", type: "submit" }, t("Log in"));
	const form = element("form", { id: "login", class: "panel login" },
		element("h1", {}, t("Log in")),
		element("p", { class: "muted" }, t("An administrator of this gateway makes users.")),
		element("label", { class: "field", for: "login-user" }, t("User"), user),
		element("label", { class: "field", for: "login-password" }, t("Password"), password),
		problem, button);

	form.addEventListener("submit", async (event) => {
		event.preventDefault();
		button.disabled = true;
		setText(problem, "");
		try {
			await logIn(user.value, password.value);
		} catch (error) {
			setText(problem, error.retry_s ?
				t("{message}; again in {retry_s} s", { message: error.message, retry_s: error.retry_s }) : error.message);
			password.value = "";
			password.focus();
		}
		button.disabled = false;
	});
	root.append(form);
	user.focus();
}

export function hide() {}
