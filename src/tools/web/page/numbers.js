/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Numbers in a language: Intl says what stands between whole and fraction. Thousands are not separated, so that what is
 * shown can be typed again. Files, and what is sent, keep the point. Pure.
 */
import { languageTag, t } from "./words.js";

/* Where a comma begins the fraction, this is a thousand to one reader and one to another. */
const TWO_MEANINGS = /^(-?[1-9]\d{0,2})\.(\d{3})(e.*)?$/i;

/*
 * tag: as "de". Returns
 *   write(text)  the text of a number, "-12.5", as it is shown
 *   read(typed)  { text }, which has a point; or { problem }: it has two meanings
 */
export function createNumbers(tag) {
	const sign = new Intl.NumberFormat(tag).formatToParts(1.5).find(({ type }) => type === "decimal").value;

	return {
		write: (text) => text.replace(".", sign),
		read(typed) {
			const found = sign === "." ? null : typed.match(TWO_MEANINGS);

			if (!found)
				return { text: typed.replace(sign, ".") };
			const [, whole, digits, exponent = ""] = found;

			return { problem: t("“{text}” can be read in two ways: write {one} or {other}", { text: typed,
				one: `${whole}${sign}${digits}${exponent}`, other: `${whole}${digits}${exponent}` }) };
		},
	};
}

/* Of the page. */
export const numbers = createNumbers(languageTag);
