/* SPDX-License-Identifier: Apache-2.0 */
/* Frames of CAN as a file that Wireshark opens, as src/ctl/pcapng.c writes it. Pure. */

const LINKTYPE_CAN_SOCKETCAN = 227;
const BLOCK_INTERFACE = 1;
const BLOCK_PACKET = 6;
const BLOCK_SECTION = 0x0a0d0d0a;
/* Of an interface; of a packet 1 is a comment, 2 the flags, 4 how many are missing before it. */
const OPTION_COMMENT = 1;
const OPTION_NAME = 2;
const OPTION_DESCRIPTION = 3;
const OPTION_RESOLUTION = 9;
const OPTION_FLAGS = 2;
const OPTION_DROPPED = 4;
const FLAG_INBOUND = 1;
const FLAG_OUTBOUND = 2;
const TEXT_MAX = 4000; // bytes

function words(...numbers) {
	return new Uint8Array(new Uint32Array(numbers).buffer);
}

function join(parts) {
	const all = new Uint8Array(parts.reduce((size, part) => size + part.length, 0));
	let at = 0;

	for (const part of parts) {
		all.set(part, at);
		at += part.length;
	}
	return all;
}

function pad(bytes) {
	return join([bytes, new Uint8Array((4 - (bytes.length % 4)) % 4)]);
}

function option(code, bytes) {
	return join([words(code + bytes.length * 0x10000), pad(bytes)]);
}

function textOption(code, text) {
	return option(code, new TextEncoder().encode(text).slice(0, TEXT_MAX));
}

/* Both ends have its length; behind the options is one that ends them. */
function block(type, ...parts) {
	const body = join([...parts, words(0)]);

	return join([words(type, body.length + 12), body, words(body.length + 12)]);
}

export function beginPcapng(name, description) {
	/* The section has no options, and its length is not told. */
	return join([
		words(BLOCK_SECTION, 28, 0x1a2b3c4d, 1, 0xffffffff, 0xffffffff, 28),
		block(
			BLOCK_INTERFACE,
			words(LINKTYPE_CAN_SOCKETCAN, 0),
			textOption(OPTION_NAME, name),
			textOption(OPTION_DESCRIPTION, description),
			option(OPTION_RESOLUTION, new Uint8Array([6]))
		)
	]);
}

/* A record that has an id; `missed` before it. */
export function writeFrame(record, comment, missed) {
	const data = new Uint8Array(
		(record.data ?? "")
			.match(/../g)
			?.slice(0, 8)
			.map((byte) => parseInt(byte, 16)) ?? []
	);
	const head = new Uint8Array(8);

	new DataView(head.buffer).setUint32(0, record.id);
	head[4] = data.length;
	const frame = join([head, data]);
	const parts = [
		words(
			0,
			Math.floor(record.time_us / 0x100000000),
			record.time_us % 0x100000000,
			frame.length,
			frame.length
		),
		pad(frame),
		option(
			OPTION_FLAGS,
			words(record.direction === "sent" ? FLAG_OUTBOUND : FLAG_INBOUND)
		),
		textOption(OPTION_COMMENT, comment)
	];

	if (missed > 0)
		parts.push(option(OPTION_DROPPED, words(missed, 0)));
	return block(BLOCK_PACKET, ...parts);
}
