/* SPDX-License-Identifier: Apache-2.0 */
/* Buttons that act only while a finger, a mouse or a key holds them. */
import { element, icon } from "./dom.js";
import { t } from "./words.js";

/* press() when it goes down, release() for whatever ends that; release is called also when nothing is
 * pressed. */
export function listenToHold(button, { press, release }) {
	button.addEventListener("pointerdown", (event) => {
		if (event.button !== 0 || !event.isPrimary)
			return;
		/* A finger that leaves the button has released it. */
		if (button.hasPointerCapture(event.pointerId))
			button.releasePointerCapture(event.pointerId);
		event.preventDefault();
		button.focus();
		press();
	});
	for (const end of ["pointerup", "pointercancel", "pointerleave", "blur"])
		button.addEventListener(end, release);
	button.addEventListener("contextmenu", (event) => event.preventDefault());
}

const RELEASE = "release-held";

/* Whatever is held is released: all drives are being stopped. */
export function releaseHeld() { window.dispatchEvent(new Event(RELEASE)); }

/* Calls release() when the page is hidden or left, when its window loses the focus, and with releaseHeld(). Returns a
 * function that ends this. */
export function releaseWithPage(release) {
	/** @type {[EventTarget, string][]} */
	const listened = [[window, "blur"], [window, "pagehide"], [document, "visibilitychange"], [window, RELEASE]];

	for (const [target, event] of listened)
		target.addEventListener(event, release);
	return () => {
		for (const [target, event] of listened)
			target.removeEventListener(event, release);
	};
}

/*
 * Two buttons, for the negative and the positive direction: press(-1 or 1) when one goes down, also by an arrow key
 * or Enter; release() for whatever ends that; isPressed() whether one is held.
 */
export function createHoldPair({ press, release, isPressed }) {
	const buttons = [-1, 1].map((direction) => {
		const drawing = icon(direction < 0 ? "backward" : "forward");
		const button = element("button", { class: "hold", type: "button",
			"aria-label": direction < 0 ? t("Hold to move in negative direction") : t("Hold to move in positive direction"),
			"data-direction": direction, "aria-keyshortcuts": "ArrowLeft ArrowRight" },
		direction < 0 ? [drawing, "−"] : ["+", drawing]);

		listenToHold(button, { press: () => press(direction), release });
		button.addEventListener("keydown", (event) => {
			const wanted = { ArrowLeft: -1, ArrowRight: 1, Enter: direction }[event.key] ?? 0;

			if (!wanted || event.ctrlKey || event.altKey || event.metaKey)
				return;
			event.preventDefault();
			if (!event.repeat && !isPressed())
				press(wanted);
		});
		button.addEventListener("keyup", (event) => {
			if (["ArrowLeft", "ArrowRight", "Enter"].includes(event.key))
				release();
		});
		return button;
	});

	return buttons;
}

/* Shows which of them is pressed: velocity is 0 when none is; held: the server has taken it. */
export function showHolds(buttons, { velocity, held }) {
	for (const button of buttons) {
		const pressed = Number(button.dataset.direction) === Math.sign(velocity);

		button.classList.toggle("pressed", pressed);
		button.classList.toggle("held", pressed && held);
	}
}
