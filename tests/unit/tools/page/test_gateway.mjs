/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { pack, readTar, unpack, writeTar } from "../../../../src/tools/web/page/archive.js";
import { HEAD, listDevices, makeFiles, readFiles, replaceDevices } from "../../../../src/tools/web/page/gateway_file.js";

const TEXT = 'bus press {\n\tdevice = "/dev/serial/by-id/usb-old"  # left\n}\nbus line {\n\tdevice = /dev/ttyS1\n}\n';
const ANSWER = { version: "0.2.0", configuration: { text: TEXT, running: "all" }, certificates: ["page.crt"],
	users: [{ user: "anna", role: "operator", drives: "lift,ram" }] };
const DAMAGED = /it is damaged, or no file of a gateway/;

const join = (parts) => Buffer.concat(parts.map((part) => Buffer.from(part)));

test("an archive has what was put into it, whatever its size and letters", async () => {
	const files = new Map([["a", ""], ["b/c", "x".repeat(512)], ["d", "ü\n".repeat(300)]]);
	const packed = await pack(writeTar(files, 1700000000));

	assert.deepEqual(readTar(await unpack(packed)), files);
	assert.throws(() => writeTar(new Map([["x".repeat(101), ""]]), 0), /the name is too long/);
});

test("a changed or cut archive is refused", async () => {
	const bytes = join(writeTar(new Map([["a", "x".repeat(600)]]), 0));

	for (const place of [0, 130, 149]) {
		const changed = Buffer.from(bytes);

		changed[place] ^= 1;
		assert.throws(() => readTar(changed), DAMAGED);
	}
	assert.throws(() => readTar(bytes.subarray(0, 1024)), DAMAGED);
	await assert.rejects(unpack(new Blob(["no gzip"])), DAMAGED);
});

test("one that grows without end is refused", async () => {
	const packed = await pack([new Uint8Array(17 * 1024 * 1024)]);

	await assert.rejects(unpack(packed), /it is too long/);
});

test("what a gateway has comes back, and no password", () => {
	const files = makeFiles(ANSWER, new Map([["lift", "acc = 5\n"]]));
	const content = readFiles(files);

	assert.equal(content.edited, TEXT);
	assert.deepEqual(content.users, ANSWER.users);
	assert.deepEqual([...content.parameters], [["lift", "acc = 5\n"]]);
	assert.deepEqual([content.certificates, content.roots], [["page.crt"], []]);
	assert.equal(files.get("configuration/access/users"), "anna:operator:lift,ram:\n");
	assert.ok(!makeFiles({ ...ANSWER, users: null }, new Map()).has("configuration/access/users"));
	/* drivebridgectl restore would take users and certificates away. */
	assert.notEqual(HEAD, "drivebridge-backup 1");
});

test("of a file of drivebridgectl, root's part is told and hashes are not looked at", () => {
	const content = readFiles(new Map([["gateway", "drivebridge-backup 1\ndrivebridge.conf\n0.2.0\n"],
		["configuration/drivebridge.conf", "modbus {}"], ["configuration/access/users", "# ours\nanna:operator:*:$y$x\n"],
		["opcua/pki/own.der", ""]]));

	assert.equal(content.edited, null);
	assert.deepEqual(content.users, [{ user: "anna", role: "operator", drives: "*" }]);
	assert.deepEqual(content.roots, ["configuration/drivebridge.conf", "opcua/pki/own.der"]);
	assert.throws(() => readFiles(new Map([["gateway", "something else\n"]])), /no file of a gateway/);
});

test("ports are found and replaced, and nothing else", () => {
	assert.deepEqual(listDevices(TEXT), ["/dev/serial/by-id/usb-old", "/dev/ttyS1"]);
	assert.equal(replaceDevices(TEXT, new Map([["/dev/ttyS1", "/dev/ttyS2"], ["/dev/serial/by-id/usb-old", ""]])),
		TEXT.replace("/dev/ttyS1", "/dev/ttyS2"));
});
