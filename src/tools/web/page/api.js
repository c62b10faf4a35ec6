/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The API of drivebridge-webd under /api/: calls, streams, the session and the beats of the dead
 * man's rule.
 *
 * A browser opens at most six connections to a server, for all its tabs together. So a tab has at
 * most two calls under way, its streams end while the tab is hidden, and a stop never waits for
 * either.
 */

import { createLateness, isLate } from "./lateness.js";
import { inLanguage, t } from "./words.js";

/* A stream sends something at least twice a second; after this time without data its values are
 * old. */
export const SILENT_AFTER_MS = 1000;
const LOST_AFTER_MS = 5000;
const RETRY_FIRST_MS = 250;
const RETRY_MOST_MS = 2000;
const CALLS_AT_ONCE = 2;
const CALL_TIMEOUT_MS = 15000;
/* For one attempt of a stop, which is repeated (stops.js). */
const STOP_TIMEOUT_MS = 1000;
/* A search of the audit trail, and a check of all of it: as long as the server takes at most. */
const AUDIT_TIMEOUT_MS = 35000;
const VERIFY_TIMEOUT_MS = 305000;
const ALIVE_EVERY_MS = 1000;
/* The gateway's clock is asked for at this interval. */
const CLOCK_EVERY_MS = 2000;
const CLOCK_FIRST_MS = 250;
const EVENT_MOST = 4 * 1024 * 1024;
/* Methods of the control socket that act; they name their tab, which then sends keep-alives. */
const ACTING = new Set(["Write", "Run", "Teach", "Forget", "Reload", "SetUp", "Scan", "commission",
	"parameters", "setup", "AcknowledgeAlarm", "Configuration", "CheckConfiguration", "SetConfiguration"]);

/* An error in place of an answer: name and parameters as in the interface, the message for
 * people. */
export class ApiError extends Error {
	constructor(name, text, { parameters = {}, status = 0, retry_s = 0 } = {}) {
		super(text ? inLanguage(text) : name);
		this.name = name;
		this.parameters = parameters;
		this.status = status;
		this.retry_s = retry_s;
	}
}

/* Random for each load of the page: claims of control, watchdogs and the history belong to this
 * tab. */
export const tab = Array.from(crypto.getRandomValues(new Uint8Array(12)),
				(byte) => byte.toString(16).padStart(2, "0"))
					.join("");

/* user, role (none, observer, operator, engineer, administrator), may (what, of look, stop, move,
 * engineer, manage, appoint, audit), drives (which; null: all), commands (that need more than to move: stop, engineer,
 * manage), password (own: it is kept here; weak: what is wrong with it; least: characters), version,
 * service (true: drivebridged is connected), stops (commands that stop). */
let session = { user: null, role: "none", may: [], drives: null,
	commands: { stop: [], engineer: [], manage: [] }, password: {}, token: "", version: "",
	service: false, stops: [] };
const sessionListeners = new Set();
let acted = false;
/* Acting calls are numbered in the order of their requests: each is carried out once, and not after
 * a stop that was requested later. */
let calls = 0;
let aliveAt = 0;
/* The newest token received from the service's clock. Calls that start or hold a motion carry it:
 * from it the service knows the longest time that the call was on its way, and how old the
 * displayed values may be. This computer's clock is not used. */
let newestToken = "";
const lateness = createLateness();
let clockAt = -Infinity;
const streams = new Set();
let asleep = false;
let underWay = 0;
const waiting = [];

/* --- the session ------------------------------------------------------------------------------ */

export function getSession() { return session; }

/* The role that has a right. */
const ROLES = { look: t("observer"), stop: t("operator"), move: t("operator"),
	engineer: t("engineer"), manage: t("engineer"), appoint: t("administrator"),
	audit: t("engineer or administrator") };
/* These are of single drives. */
const OF_DRIVES = ["move", "engineer", "audit"];

/* Why the user may not do something, or not to this drive ("": the whole gateway; undefined: any); ""
 * if he may. */
export function whyNot(what, drive) {
	const { drives, role, user } = session;

	if (!session.may?.includes(what))
		return what === "manage" && role === "engineer" ?
			t("This needs all drives; {user} has {drives}.", { user, drives: drives.join(", ") }) :
			t("This needs the role {role}.", { role: ROLES[what] });
	if (!OF_DRIVES.includes(what) || drive === undefined || !drives || drives.includes(drive))
		return "";
	return t("{drive} is not among the drives of {user}: {drives}.",
		{ drive: drive || t("This"), user, drives: drives.join(", ") });
}

/* Why the health of a drive is not shown to the user; "": it is. */
export function whyNotSee(drive) {
	const { drives, user } = session;

	return !drives || drives.includes(drive) ? "" :
		`${drive} is not among the drives of ${user}: ${drives.join(", ")}.`;
}

export function may(what, drive) { return whyNot(what, drive) === ""; }

/* The same for a command. */
export function whyNotRun(command, drive) {
	const { stop = [], engineer = [], manage = [] } = session.commands ?? {};

	if (stop.includes(command))
		return whyNot("stop");
	return whyNot(engineer.includes(command) ? "engineer" : "move",
		manage.includes(command) ? "" : drive);
}

/* Returns a function that unsubscribes. */
export function onSession(listener) {
	sessionListeners.add(listener);
	return () => sessionListeners.delete(listener);
}

/* Whether another user, or the same one with other rights, sees another page. */
export function hasOtherRights(one, other) {
	return one.user !== other.user || one.role !== other.role ||
		String(one.may) !== String(other.may) || String(one.drives) !== String(other.drives);
}

function takeSession(next) {
	const before = session;

	/* A server that has not reached the service yet knows none. */
	session = next.stops?.length > 0 ? next : { ...next, stops: before.stops };
	if (hasOtherRights(before, session))
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

/* The user's own; then the session is told anew. */
export async function changePassword(password, fresh) {
	await ask("POST", "password", { password, fresh });
	return loadSession();
}

/* The user's own sessions: [{ number, from, begun_ms, used_ms, own }], own: this one. */
export async function listSessions() { return (await ask("POST", "sessions", {})).sessions; }

/* which: { number }, or { others: true }. Promises those that are left. */
export async function endSessions(which) { return (await ask("POST", "sessions/end", which)).sessions; }

export async function listUsers() { return (await ask("POST", "users", {})).users; }

/* user, role, drives ("*" or names with commas), pam, password (missing: it stays). */
export async function putUser(user) { return ask("POST", "users/put", user); }

export async function removeUser(user) { return ask("POST", "users/remove", { user }); }

/* Records of the audit trail, newest first: { before, and a filter } promises { records, before,
 * over, trail }. */
export async function askAudit(parameters) {
	return ask("POST", "audit", parameters, { timeout: AUDIT_TIMEOUT_MS });
}

/* Promises { checked, broken, more_broken, trail }. */
export async function verifyAudit() {
	return ask("POST", "audit/verify", {}, { timeout: VERIFY_TIMEOUT_MS });
}

/* { version, configuration, users (null: not for this user), certificates } */
export async function askGateway() { return ask("POST", "gateway", {}); }

/* { for_s, step_s } promises { times, rows, step_s, now_us, on, kept, trouble } of all drives. */
export async function askHealthRows(parameters) { return ask("POST", "health/rows", parameters); }

/* The same with `drive` promises { values, running ... } of one. */
export async function askHealth(parameters) { return ask("POST", "health", parameters); }

/* Alarms that changed after this change: { alarms, change, over, on, kept, trouble }. */
export async function askAlarms(after) { return ask("POST", "alarms", { after }); }

export async function acknowledgeAlarm({ id, kind, name }) {
	return call("AcknowledgeAlarm", { id, drive: kind === "drive" ? name : "" });
}

export async function logOut() { return takeSession(await ask("POST", "logout", {})); }

/* --- calls ------------------------------------------------------------------------------------ */

/**
 * @param {string} method
 * @param {string} path
 * @param {object | undefined} parameters
 * @param {{ signal?: AbortSignal, keepalive?: boolean, named?: boolean, number?: number,
 *	stops?: boolean }} options
 */
async function request(method, path, parameters, { signal, keepalive, named, number, stops } = {}) {
	/** @type {Record<string, string>} */
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
		throw new ApiError("Unreachable", t("the gateway does not answer"));
	}
}

async function readError(response) {
	let body = {};

	try {
		body = await response.json();
	} catch {
		/* Not from our server: from a proxy, for example. */
	}
	return new ApiError(body.error ?? "BadAnswer",
		body.text || t("the gateway answers {status}", { status: `${response.status} ${response.statusText}` }),
		{ ...body, status: response.status });
}

/* A request of this server's own: GET or POST of a path below /api/. */
export async function ask(method, path, parameters, options = {}) {
	const limit = AbortSignal.timeout(options.timeout ?? CALL_TIMEOUT_MS);
	const response = await request(method, path, parameters, { ...options,
		signal: limit }).catch((error) => {
		throw error instanceof ApiError ?
			error :
			new ApiError("Timeout", t("the gateway does not answer in time"));
	});

	if (response.ok)
		return response.json();
	throw await readError(response);
}

/* After the end of a session, a restart of the gateway or a new login in another tab the token is
 * another one. A call refused for that reason was not carried out; but only a stop may be sent so
 * late, any other call is left to people. */
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

/* Stops come first: they do not wait in the queue. */
export function isStop(method, parameters) {
	return (method === "Run" && session.stops.includes(parameters.command)) ||
		(method === "Write" && parameters.drive === "");
}

/* Adds the token to calls whose age the service has to know. */
function withToken(method, parameters) {
	return ["Run", "Write"].includes(method) ? { ...parameters, token: newestToken } : parameters;
}

/*
 * Calls one of the interface's methods (docs/io.drivebridge.Control.varlink) with its parameters;
 * resolves with those of its answer, rejects with an ApiError. Acting calls are never repeated by
 * themselves, except a stop whose token was another login's. A stop has STOP_TIMEOUT_MS: stops.js
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
 * A beat of a grip, for the dead man's rule. A grip is one press of a button or key, with its own
 * number. `velocity` 0 releases it. Resolves with { held, why, text, result }.
 */
export function sendBeat(drive, grip, beat, velocity) {
	beginToAct();
	return ask("POST", "jog", { drive, grip, beat, velocity, token: newestToken },
		{ named: true, keepalive: velocity === 0, timeout: 2000, number: ++calls });
}

/* The same for a sequence: { grip, beat, held, steps }, held false releases it. Resolves with { held, why,
 * text, step, moves, wait_ms }. */
export function sendSequenceBeat(beat) {
	beginToAct();
	return ask("POST", "sequence", { ...beat, token: newestToken },
		{ named: true, keepalive: !beat.held, timeout: 2000, number: ++calls });
}

/*
 * A message to the commissioning that this tab has begun (openStream("commission")): no parameters:
 * the tab is there; { motion }: the user watches this motion; { question, answer }; or { end: true
 * }.
 */
export function sayToCommission(parameters, { keepalive = false } = {}) {
	return ask("POST", "commission", { ...parameters, token: newestToken },
		{ named: true, keepalive, timeout: 2000 });
}

/* Promises [{ step, moves, chosen, description }]. */
export async function listCommissionSteps() {
	return (await ask("POST", "commission/steps", {})).steps;
}

/* --- keep-alives of an acting tab
 * -------------------------------------------------------------- */

function beginToAct() { acted = true; }

/* Also called from streams: their data are not delayed in a background tab, as timers are. */
function sayAlive() {
	const now = performance.now();

	if (!acted || now - aliveAt < ALIVE_EVERY_MS * 0.9)
		return;
	aliveAt = now;
	ask("POST", "alive", {}, { named: true, timeout: 3000 }).then(
		({ moment }) => lateness.takeTrip(now, moment),
		(error) => {
			if (error.name === "LoginRequired" || error.name === "BadToken")
				loadSession().catch(() => {});
		});
}

/* The keep-alives of a tab that has acted tell the gateway's clock as well. */
function askClock() {
	const now = performance.now();
	const every = lateness.isKnown() ? CLOCK_EVERY_MS : CLOCK_FIRST_MS;

	if (acted || streams.size === 0 || asleep || now - clockAt < every)
		return;
	clockAt = now;
	ask("POST", "clock", {}, { timeout: 5000 })
		.then(({ moment }) => lateness.takeTrip(now, moment), () => {});
}

/* True if this tab has moved something, or taken control of it. */
export function hasActed() { return acted; }

/* --- streams ---------------------------------------------------------------------------------- */

/*
 * Reads server-sent events from pieces of text and calls onEvent(name, data, moment) for each
 * complete one; the moment is the gateway's, at which it was written (undefined: not told). Comments and texts that are no JSON are skipped. Pure.
 */
export function createEventReader(onEvent) {
	let rest = "";

	return (text) => {
		let end;

		rest += text;
		while ((end = rest.indexOf("\n\n")) >= 0) {
			let name = "";
			let data = "";
			let moment;

			for (const line of rest.slice(0, end).split("\n")) {
				if (line.startsWith("data:"))
					data += line.slice(5);
				else if (line.startsWith("event:"))
					name = line.slice(6).trim();
				else if (line.startsWith("id:"))
					moment = Number(line.slice(3));
			}
			rest = rest.slice(end + 2);
			if (data === "")
				continue;
			try {
				data = JSON.parse(data);
			} catch {
				continue;
			}
			onEvent(name, data, moment);
		}
		if (rest.length > EVENT_MOST)
			rest = "";
	};
}

/*
 * Opens a stream: "overview", or a method of the interface that streams. Handlers, all optional:
 *   onData(parameters, ms)  each answer, and how long it can have been under way at most (null: not
 *                          known)
 *   onEvent(name, data)    other events by name, such as `service`
 *   onState(state, error)  connecting, live; the values shown are old: late (they come, but have been
 *                          under way for more than a second), hung (the gateway is there, its
 *                          service says nothing), silent (nothing comes), lost (opened again by
 *                          itself); ended, failed (with an ApiError; not opened again)
 * A stream with `once` is not opened again when it is lost, and continues while the tab is hidden:
 * a scan. One that is `timed`, the overview, is live while it has tokens of the service's clock: its
 * server may run longer than the service. Returns { close(), age() }: how old its newest values are
 * at most in ms, null: not known.
 */
export function openStream(method, parameters = {}, handlers = {}) {
	const stream = {
		state: "",
		heardAt: 0,
		clockAt: 0,
		moment: undefined,
		retry: RETRY_FIRST_MS,
		timer: 0,
		abort: null,
		closed: false
	};
	const { onData, onEvent, onState, once, timed } = handlers;

	stream.once = once;
	if (ACTING.has(method))
		beginToAct();

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

	/* Values are as old as the newest of them: of the overview, its tokens. */
	function judgeAge(now) {
		if (!stream.abort || !["live", "late", "connecting", "hung", "silent"].includes(stream.state))
			return;
		const age = lateness.ageOf(stream.moment, now);

		if (now - stream.clockAt > SILENT_AFTER_MS) {
			if (stream.state === "connecting")
				return;
			setState(now - stream.heardAt > SILENT_AFTER_MS ? "silent" : "hung");
		} else if (age !== null) {
			setState(isLate(age, stream.state === "late") ? "late" : "live");
		}
	}

	function takeEvent(name, data, moment) {
		const now = performance.now();

		if (moment !== undefined) {
			lateness.takeMoment(moment, now);
			/* Values, and tokens of the service's clock: not what the gateway has kept. */
			if (timed ? name === "token" : data.samples)
				stream.moment = moment;
		}
		if (name === "error") {
			finish("failed", new ApiError(data.error, data.text, data));
			/* The session has ended, by time or because the user was changed. */
			if (data.error === "LoginRequired")
				loadSession().catch(() => {});
		} else if (name === "end")
			finish("ended");
		else if (name)
			takeNamed(name, data);
		else
			onData?.(data, lateness.ageOf(timed ? stream.moment : moment, now));
	}

	function takeNamed(name, data) {
		if (name === "token") {
			newestToken = data.token;
			stream.clockAt = performance.now();
			if (timed)
				judgeAge(stream.clockAt);
		} else if (name === "service" && data.stops?.length > 0) {
			session = { ...session, stops: data.stops };
		}
		onEvent?.(name, data);
	}

	async function read(abort) {
		const acts = ACTING.has(method);
		const response = await request("POST", `stream/${method}`, parameters,
			{ signal: abort.signal, named: acts, number: acts ? ++calls : undefined });

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
		stream.moment = undefined;
		setState("connecting");
		try {
			await read(abort);
		} catch (error) {
			/* After a restart of the gateway or the end of a login the session is
			 * another one: load it, so that streams that it may not read are closed. */
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
				new ApiError("Lost", t("the connection to the gateway was lost")));
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

	/* Called each quarter of a second. */
	stream.look = (now) => {
		if (!stream.abort || stream.state === "lost")
			return;
		if (timed)
			judgeAge(now);
		else if (now - stream.heardAt > SILENT_AFTER_MS && stream.state === "live")
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
	askClock();
	return { close: stream.close, age: () => lateness.ageOf(stream.moment, performance.now()) };
}

/* While a tab that has moved nothing is hidden, its streams end, so that other tabs find a
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

/* Starts the page's timers; called once. */
export function startApi() {
	setInterval(() => {
		const now = performance.now();

		for (const stream of streams)
			stream.look(now);
		sayAlive();
		askClock();
	}, 250);
}
