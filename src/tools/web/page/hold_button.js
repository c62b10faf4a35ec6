/* SPDX-License-Identifier: Apache-2.0 */
/* A button that acts only while a finger, a mouse or the Enter key holds it. */

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

/* Calls release() when the page is hidden or left, or its window loses the focus. Returns a function
 * that ends this. */
export function releaseWithPage(release) {
	/** @type {[EventTarget, string][]} */
	const listened = [[window, "blur"], [window, "pagehide"], [document, "visibilitychange"]];

	for (const [target, event] of listened)
		target.addEventListener(event, release);
	return () => {
		for (const [target, event] of listened)
			target.removeEventListener(event, release);
	};
}
