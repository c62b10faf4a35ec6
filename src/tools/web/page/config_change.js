/* SPDX-License-Identifier: Apache-2.0 */
/* Saving the edited part of the configuration, and loading it, once the user has seen what that does. */
import { call } from "./api.js";
import { describeEffects, readMessage } from "./config_text.js";
import { askUser } from "./question.js";
import { inLanguage, t } from "./words.js";

/*
 * Asks the user, and writes. path and version are those of the answer of Configuration. Resolves with
 * false when the user did not want it; rejects with what is wrong.
 */
export async function saveConfiguration({ text, path, version }, question) {
	const checked = await call("CheckConfiguration", { text });

	if (!checked.good)
		throw new Error(t("It has mistakes: {messages}", { messages: checked.messages.map(inLanguage).join("; ") }));
	const effects = describeEffects(checked.effects);

	if (!await askUser({
		title: question,
		words: [...(effects.length > 0 ? effects : [t("No drive changes.")]),
			...checked.messages.map((message) => readMessage(message, path).text)],
		yes: checked.effects.some(({ moves }) => moves) ? t("Save and load, also what moves") :
			t("Save and load")
	}))
		return false;
	const written = await call("SetConfiguration", { text, version });

	if (!written.good)
		throw new Error(written.messages.map(inLanguage).join("; "));
	return true;
}

/* Resolves with whether it is in force; what is wrong the user is told. */
export async function loadConfiguration(context) {
	const { messages } = await call("Reload");

	if (messages.length > 0)
		context.notify(t("It was not loaded: {messages}", { messages: messages.map(inLanguage).join("; ") }), "error");
	else
		context.notify(t("The configuration is loaded"), "ok");
	return messages.length === 0;
}
