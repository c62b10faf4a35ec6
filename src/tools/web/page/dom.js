/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Elements without HTML in texts: a text of a drive, a configuration or a user is never more than
 * text.
 */

const SVG = "http://www.w3.org/2000/svg";

/*
 * element("button", { class: "primary", type: "button", "aria-label": "Stop", onclick: f, disabled:
 * true }, "Stop") Properties that begin with "on" are listeners, true and false set and leave out
 * an attribute, null and undefined are left out. Children are nodes, texts, or arrays of them.
 */
export function element(tag, properties = {}, ...children) {
	const node = document.createElement(tag);

	for (const [name, value] of Object.entries(properties)) {
		if (name.startsWith("on"))
			node.addEventListener(name.slice(2), value);
		else if (value === true)
			node.setAttribute(name, "");
		else if (value !== false && value !== null && value !== undefined)
			node.setAttribute(name, value);
	}
	node.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined));
	return node;
}

/* One of the drawings in index.html, as decoration next to a word. */
export function icon(name) {
	const node = document.createElementNS(SVG, "svg");
	const use = document.createElementNS(SVG, "use");

	node.setAttribute("class", "icon");
	node.setAttribute("aria-hidden", "true");
	use.setAttribute("href", `#icon-${name}`);
	node.append(use);
	return node;
}

export function setIcon(node, name) {
	const use = node.firstChild;

	if (use.getAttribute("href") !== `#icon-${name}`)
		use.setAttribute("href", `#icon-${name}`);
}

/* Changes the document only when something differs: at 10 Hz most texts do not. */
export function setText(node, text) {
	if (node.textContent !== text)
		node.textContent = text;
}

export function setAttribute(node, name, value) {
	if (node.getAttribute(name) !== value)
		node.setAttribute(name, value);
}

let lastId = 0;

/* For labels and the elements that they belong to. */
export function newId(prefix) { return `${prefix}-${++lastId}`; }

/* A control, which has an id, below its label; `place` is a class such as `inline`: next to it. */
export function createField(words, control, place = "") {
	return element("label", { class: `field ${place}`.trim(), for: control.id }, words, control);
}
