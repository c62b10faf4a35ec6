/* SPDX-License-Identifier: Apache-2.0 */
import { element } from "./dom.js";

export const title = "Parameters";

export function show(root) {
	root.append(element("p", { class: "empty" }, "Not here yet."));
}

export function hide() {}
