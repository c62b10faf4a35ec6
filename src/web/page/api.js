/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What drivebridge-webd offers under /api/: calls, streams, the session and the dead man's beat.
 *
 * A browser opens six connections to a server and no more, all its tabs together. So a tab has at
 * most two calls under way, its streams end while nobody looks, and a stop never waits behind
 * either.
 */

/* Nothing for so long from a stream that says something at least twice a second: what it showed
 * is old. */
export const SILENT_AFTER_MS = 1000;
const LOST_AFTER_MS = 5000;
const RETRY_FIRST_MS = 250;
const RETRY_MOST_MS = 2000;
const CALLS_AT_ONCE = 2;
const CALL_TIMEOUT_MS = 15000;
/* Of one try of a stop, which is sent again (stops.js). */
const STOP_TIMEOUT_MS = 1000;
const ALIVE_EVERY_MS = 1000;
const EVENT_MOST = 4 * 1024 * 1024;
/* Methods of the control socket that act; their tab is named, and lives by saying so. */
const ACTING = new Set(["Write", "Run", "Reload", "SetUp", "Scan"]);

/* An answer that is none: name and parameters as in the interface, the message for people. */
export class ApiError extends Error {
	constructor(name, text, { parameters = {}, status = 0, retry_s = 0 } = {}) {
		super(text || name);
		this.name = name;
		this.parameters = parameters;
		this.status = status;
		this.retry_s = retry_s;
	}
}

/* Random for each load of the page: claims of control, watchdogs and the history are this tab's
 * own. */
export const tab = Array.from(crypto.getRandomValues(new Uint8Array(12)),
				(byte) => byte.toString(16).padStart(2, "0"))
					.join("");

/* user, role (none, reader, operator), version, service (whether drivebridged is there), stops
 * (commands that are). */
let session = { user: null, role: "none", token: "", version: "", service: false, stops: [] };
const sessionListeners = new Set();
let acted = false;
/* What acts is numbered in the order in which it was asked for: carried out once, and not behind a stop that came
 * after it. */
let calls = 0;
let aliveAt = 0;
/* The newest token of the service's clock that has come here. What starts or holds a motion carries it: so the service
 * knows how long the call was on its way, and how old what is shown here may be. No clock of this computer is asked. */
let newestToken = "";
const streams = new Set();
let asleep = false;
let underWay = 0;
const waiting = [];

/* --- the session ------------------------------------------------------------------------------ */

export function getSession() { return session; }

/* Returns a function that ends it. */
export function onSession(listener) {
	sessionListeners.add(listener);
	return () => sessionListeners.delete(listener);
}

function takeSession(next) {
	const before = session;

	session = next;
	if (before.user !== next.user || before.role !== next.role)
		acted = false;
	for (const listener of sessionListeners)
		listener(session, before);
	return session;
}

export async function loadSession(options) {
	return takeSession(await ask("GET", "session", undefined, options));
}

export async function logIn(user, password) {
	return takeSession(await ask("POST", "login", { user, password }));
}

export async function logOut() { return takeSession(await ask("POST", "logout", {})); }

/* --- calls ------------------------------------------------------------------------------------ */

async function request(method, path, parameters, { signal, keepalive, named, number, stops } = {}) {
	const headers = {};

	if (method === "POST") {
		headers["Content-Type"] = "application/json";
		headers["X-Drivebridge"] = session.token;
	}
	if (named || acted)
		headers["X-Tab"] = tab;
	if (number)
		headers["X-Call"] = String(number);
	try {
		return await fetch(`/api/${path}`, {
			method,
			headers,
			body: method === "POST" ? JSON.stringify(parameters ?? {}) : undefined,
			credentials: "same-origin",
			cache: "no-store",
			redirect: "error",
			priority: stops ? "high" : "auto",
			keepalive,
			signal,
		});
	} catch (error) {
		if (signal?.aborted)
			throw error;
		throw new ApiError("Unreachable", "the gateway does not answer");
	}
}

async function readError(response) {
	let body = {};

	try {
		body = await response.json();
	} catch {
		/* Not ours: a proxy's, say. */
	}
	return new ApiError(body.error ?? "BadAnswer",
		body.text || `the gateway answers ${response.status} ${response.statusText}`,
		{ ...body, status: response.status });
}

async function ask(method, path, parameters, options = {}) {
	const limit = AbortSignal.timeout(options.timeout ?? CALL_TIMEOUT_MS);
	const response = await request(method, path, parameters, { ...options,
		signal: limit }).catch((error) => {
		throw error instanceof ApiError ?
			error :
			new ApiError("Timeout", "the gateway does not answer in time");
	});

	if (response.ok)
		return response.json();
	throw await readError(response);
}

/* A session that has ended, or of a gateway that was restarted, has another token; so has a new login in another tab.
 * What was refused for that was not carried out; but only a stop may come so late, any other thing is for people. */
async function askAgain(path, parameters, options) {
	const { token } = session;

	try {
		return await ask("POST", path, parameters, options);
	} catch (error) {
		if (error.name !== "LoginRequired" && error.name !== "BadToken")
			throw error;
		await loadSession({ timeout: options.timeout });
		if ((options.named && !options.stops) || session.role === "none" ||
		    token === session.token)
			throw error;
		return ask("POST", path, parameters, options);
	}
}

async function takeTurn() {
	if (underWay >= CALLS_AT_ONCE)
		await new Promise((resolve) => waiting.push(resolve));
	underWay++;
}

function endTurn() {
	underWay--;
	waiting.shift()?.();
}

/* Stops come first: they take no turn. */
export function isStop(method, parameters) {
	return (method === "Run" && session.stops.includes(parameters.command)) ||
		(method === "Write" && parameters.drive === "");
}

/* What the service is to know the age of. */
function withToken(method, parameters) {
	return ["Run", "Write"].includes(method) ? { ...parameters, token: newestToken } : parameters;
}

/*
 * One of the interface's methods (docs/io.drivebridge.Control.varlink) with its parameters;
 * resolves with those of its answer, rejects with an ApiError. What acts is never repeated by
 * itself, but for a stop whose token was another login's. A stop has STOP_TIMEOUT_MS: stops.js
 * repeats it.
 */
export async function call(method, parameters = {}) {
	const acts = ACTING.has(method);
	const first = isStop(method, parameters);
	const number = acts ? ++calls : undefined;

	if (acts)
		beginToAct();
	if (!first)
		await takeTurn();
	try {
		return await askAgain(
			`call/${method}`, first ? parameters : withToken(method, parameters), { named: acts, stops: first, keepalive: first, number,
				timeout: first ? STOP_TIMEOUT_MS : CALL_TIMEOUT_MS });
	} finally {
		if (!first)
			endTurn();
	}
}

/*
 * The dead man's beat of a grip: a press of a button or key with a number of its own. `velocity` 0
 * lets go. Resolves with { held, why, text, result }.
 */
export function sendBeat(drive, grip, beat, velocity) {
	beginToAct();
	return ask("POST", "jog", { drive, grip, beat, velocity, token: newestToken },
		{ named: true, keepalive: velocity === 0, timeout: 2000, number: ++calls });
}

/* --- a tab that acts says that it is there ---------------------------------------------------- */

function beginToAct() { acted = true; }

/* Also from streams: what they bring is not held back in a tab in the background, as timers are. */
function sayAlive() {
	const now = performance.now();

	if (!acted || now - aliveAt < ALIVE_EVERY_MS * 0.9)
		return;
	aliveAt = now;
	ask("POST", "alive", {}, { named: true, timeout: 3000 }).catch((error) => {
		if (error.name === "LoginRequired" || error.name === "BadToken")
			loadSession().catch(() => {});
	});
}

/* Whether this tab has moved something, or taken control of it. */
export function hasActed() { return acted; }

/* --- streams ---------------------------------------------------------------------------------- */

/*
 * Takes the text of a stream of server-sent events piece by piece and calls onEvent(name, data) for
 * each that is whole; comments and what is no JSON are passed over. Pure.
 */
export function createEventReader(onEvent) {
	let rest = "";

	return (text) => {
		let end;

		rest += text;
		while ((end = rest.indexOf("\n\n")) >= 0) {
			let name = "";
			let data = "";

			for (const line of rest.slice(0, end).split("\n")) {
				if (line.startsWith("data:"))
					data += line.slice(5);
				else if (line.startsWith("event:"))
					name = line.slice(6).trim();
			}
			rest = rest.slice(end + 2);
			if (data === "")
				continue;
			try {
				data = JSON.parse(data);
			} catch {
				continue;
			}
			onEvent(name, data);
		}
		if (rest.length > EVENT_MOST)
			rest = "";
	};
}

/*
 * Opens a stream: "overview", or a method of the interface that streams. Handlers, all optional:
 *   onData(parameters)     each answer
 *   onEvent(name, data)    other events by name, such as `service`
 *   onState(state, error)  connecting, live, silent (what was shown is old), lost (opened again by
 *                          itself), ended, failed (with an ApiError; not opened again)
 * A stream with `once` is not opened again when it is lost, and goes on while nobody looks: a scan. One that is `timed`,
 * the overview, is live while the service's clock is to be heard in it: its server may live longer than the service.
 * Returns { close() }.
 */
export function openStream(method, parameters = {}, handlers = {}) {
	const stream = {
		state: "",
		heardAt: 0,
		clockAt: 0,
		retry: RETRY_FIRST_MS,
		timer: 0,
		abort: null,
		closed: false
	};
	const { onData, onEvent, onState, once, timed } = handlers;

	stream.once = once;

	function setState(state, error) {
		if (stream.state === state)
			return;
		stream.state = state;
		onState?.(state, error);
	}

	function finish(state, error) {
		stream.close();
		setState(state, error);
	}

	function takeEvent(name, data) {
		if (name === "error")
			finish("failed", new ApiError(data.error, data.text, data));
		else if (name === "end")
			finish("ended");
		else if (name)
			takeNamed(name, data);
		else
			onData?.(data);
	}

	function takeNamed(name, data) {
		if (name === "token") {
			newestToken = data.token;
			stream.clockAt = performance.now();
			setState("live");
		}
		onEvent?.(name, data);
	}

	async function read(abort) {
		const response = await request("POST", `stream/${method}`, parameters,
			{ signal: abort.signal, named: ACTING.has(method) });

		if (!response.ok)
			throw await readError(response);
		const reader = response.body.getReader();
		const decoder = new TextDecoder();
		const take = createEventReader(takeEvent);

		stream.retry = RETRY_FIRST_MS;
		for (;;) {
			const { done, value } = await reader.read();

			if (done || abort.signal.aborted)
				return;
			stream.heardAt = performance.now();
			if (!timed)
				setState("live");
			take(decoder.decode(value, { stream: true }));
			sayAlive();
		}
	}

	stream.open = async () => {
		const abort = new AbortController();

		stream.abort = abort;
		stream.heardAt = performance.now();
		setState("connecting");
		try {
			await read(abort);
		} catch (error) {
			/* The gateway was restarted, or the login has ended: then another
			 * session closes what it may not see. */
			if (error.name === "BadToken" || error.name === "LoginRequired")
				await loadSession().catch(() => {});
			if (!abort.signal.aborted && error instanceof ApiError &&
				error.status >= 400 && error.status < 500 && error.status !== 429 &&
				error.name !== "BadToken")
				finish("failed", error);
		}
		if (stream.closed || stream.abort !== abort)
			return;
		stream.abort = null;
		if (once) {
			finish("failed",
				new ApiError("Lost", "the connection to the gateway was lost"));
			return;
		}
		setState("lost");
		stream.timer = setTimeout(stream.open, stream.retry);
		stream.retry = Math.min(stream.retry * 2, RETRY_MOST_MS);
	};

	stream.suspend = () => {
		clearTimeout(stream.timer);
		stream.abort?.abort();
		stream.abort = null;
		setState("lost");
	};

	/* Each quarter of a second. */
	stream.look = (now) => {
		if (!stream.abort || stream.state === "lost")
			return;
		if (now - (timed ? stream.clockAt : stream.heardAt) > SILENT_AFTER_MS && stream.state === "live")
			setState("silent");
		if (now - stream.heardAt > LOST_AFTER_MS)
			stream.abort.abort();
	};

	stream.close = () => {
		stream.closed = true;
		clearTimeout(stream.timer);
		stream.abort?.abort();
		streams.delete(stream);
	};

	streams.add(stream);
	if (!asleep || once)
		stream.open();
	return { close: stream.close };
}

/* While nobody looks at a tab that has moved nothing its streams end, so that other tabs find a
 * connection. */
export function setAsleep(next) {
	if (asleep === next)
		return;
	asleep = next;
	for (const stream of streams) {
		if (stream.once)
			continue;
		if (asleep)
			stream.suspend();
		else
			stream.open();
	}
}

/* The page's clockwork; called once. */
export function startApi() {
	setInterval(() => {
		const now = performance.now();

		for (const stream of streams)
			stream.look(now);
		sayAlive();
	}, 250);
}
