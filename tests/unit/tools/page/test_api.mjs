/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { ApiError, call, createEventReader, loadSession, tab } from "../../../../src/tools/web/page/api.js";

function readAll(pieces) {
	const events = [];
	const take = createEventReader((name, data) => events.push([name, data]));

	pieces.forEach(take);
	return events;
}

test("events come whole however they are cut", () => {
	const text = `: alive\n\ndata: {"a": 1}\n\nevent: service\ndata: {"up": false}\n\nevent: end\ndata: {}\n\n`;
	const whole = [["", { a: 1 }], ["service", { up: false }], ["end", {}]];

	assert.deepEqual(readAll([text]), whole);
	assert.deepEqual(readAll([...text]), whole);
	for (let cut = 1; cut < text.length; cut++)
		assert.deepEqual(readAll([text.slice(0, cut), text.slice(cut)]), whole);
});

test("what is no event is passed over", () => {
	assert.deepEqual(readAll(["data: {broken\n\n", "event: x\n\n", "nonsense\n\n", "data: 1\n\n"]), [["", 1]]);
});

test("an endless event does not fill the memory", () => {
	const events = [];
	const take = createEventReader((name, data) => events.push(data));

	take('data: "');
	for (let i = 0; i < 50; i++)
		take("x".repeat(200000));
	take('"\n\ndata: 2\n\n');
	assert.deepEqual(events, [2]);
});

test("a tab's id is what the server takes, and errors keep what they came with", () => {
	assert.match(tab, /^[0-9a-f]{16,32}$/);
	const error = new ApiError("Refused", "limit: too far", { parameters: { result: "limit" }, status: 409 });

	assert.deepEqual([error.name, error.message, error.parameters.result, error.status],
		["Refused", "limit: too far", "limit", 409]);
});

/* A gateway whose session is another one from the second inquiry on, as behind a login in another tab. */
async function askBehindLogin(t, ...asked) {
	const tokens = ["old", "new"];
	const carriedOut = [];
	let valid = "";

	t.mock.method(globalThis, "fetch", async (path, { headers }) => {
		if (path === "/api/session") {
			valid = tokens.shift() ?? valid;
			return Response.json({ user: "anna", role: "engineer", may: ["look", "stop", "move", "engineer", "manage"], token: valid, service: true,
				stops: ["stop", "quick_stop", "disable"] });
		}
		if (headers["X-Drivebridge"] !== "new")
			return Response.json({ error: "BadToken", text: "" }, { status: 403 });
		carriedOut.push(path);
		return Response.json({ result: "done" });
	});
	await loadSession();
	const end = await Promise.allSettled(asked.map((parameters) => call("Run", parameters)));

	return { carriedOut, end };
}

test("a stop behind a login in another tab is told again with the new token", async (t) => {
	const { carriedOut, end } = await askBehindLogin(t, { drive: "x", command: "stop" },
		{ drive: "y", command: "stop" });

	assert.deepEqual(end.map(({ status }) => status), ["fulfilled", "fulfilled"]);
	assert.deepEqual(carriedOut, ["/api/call/Run", "/api/call/Run"]);
});

test("a motion behind a login in another tab is not begun by itself", async (t) => {
	const { carriedOut, end } = await askBehindLogin(t, { drive: "x", command: "move_relative" });

	assert.equal(end[0].reason.name, "BadToken");
	assert.deepEqual(carriedOut, []);
});
