/* SPDX-License-Identifier: Apache-2.0 */
import { t } from "./words.js";
/*
 * Files in one file, as tar and gzip make it: so a terminal can look into it as well. Paths have up to
 * 100 bytes, which is more than a drive's name needs. Pure, but for the browser's streams.
 */

const BLOCK = 512;
const LIMIT = 16 * 1024 * 1024;
const MODE = "0000600";

function writeHead(path, size, timeS) {
	const head = new Uint8Array(BLOCK);
	const put = (at, text) => head.set(new TextEncoder().encode(text), at);
	const octal = (number, digits) => number.toString(8).padStart(digits, "0");

	put(0, path);
	put(100, MODE);
	put(108, octal(0, 7));
	put(116, octal(0, 7));
	put(124, octal(size, 11));
	put(136, octal(timeS, 11));
	put(148, "        ");
	put(156, "0");
	put(257, "ustar\u000000");
	put(148, `${octal(head.reduce((sum, byte) => sum + byte, 0), 6)}\0 `);
	return head;
}

/* A Map of texts by path as the bytes of a tar archive. */
export function writeTar(files, timeS) {
	const parts = [];

	for (const [path, text] of files) {
		const bytes = new TextEncoder().encode(text);

		if (new TextEncoder().encode(path).length > 100)
			throw new Error(t("{path}: the name is too long", { path }));
		parts.push(writeHead(path, bytes.length, timeS), bytes, new Uint8Array(-bytes.length & (BLOCK - 1)));
	}
	parts.push(new Uint8Array(2 * BLOCK));
	return parts;
}

/* The texts of a tar archive by path, without "./"; rejects what is none. */
export function readTar(bytes) {
	const files = new Map();
	const text = (from, size) => new TextDecoder().decode(bytes.subarray(from, from + size)).split("\0")[0];

	for (let at = 0; at + BLOCK <= bytes.length && bytes[at] !== 0;) {
		const size = parseInt(text(at + 124, 12), 8);
		const sum = bytes.subarray(at, at + BLOCK).reduce((all, byte, index) =>
			all + (index >= 148 && index < 156 ? 32 : byte), 0);

		if (!(size >= 0) || parseInt(text(at + 148, 8), 8) !== sum || at + BLOCK + size > bytes.length)
			throw new Error(t("it is damaged, or no file of a gateway"));
		if (["0", ""].includes(text(at + 156, 1)))
			files.set(text(at, 100).replace(/^\.\//, ""), text(at + BLOCK, size));
		at += BLOCK + Math.ceil(size / BLOCK) * BLOCK;
	}
	return files;
}

/* A Blob of these parts, packed. */
export function pack(parts) {
	return new Response(new Blob(parts).stream().pipeThrough(new CompressionStream("gzip"))).blob();
}

/* The bytes of a packed file; one that grows without end is refused. */
export async function unpack(file) {
	const reader = file.stream().pipeThrough(new DecompressionStream("gzip")).getReader();
	const parts = [];
	let size = 0;

	for (;;) {
		const { done, value } = await reader.read().catch(() => {
			throw new Error(t("it is damaged, or no file of a gateway"));
		});

		if (done)
			return new Uint8Array(await new Blob(parts).arrayBuffer());
		size += value.length;
		parts.push(value);
		if (size > LIMIT) {
			reader.cancel();
			throw new Error(t("it is too long for a file of a gateway"));
		}
	}
}
