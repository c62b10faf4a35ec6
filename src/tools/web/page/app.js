/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The shell: routes by location.hash, the session, the link's state, and functions for all views.
 *
 * A view exports { title, show(root, context, ...args), hide() }. show() fills `root`, an empty
 * element, and may be async; hide() ends its streams and timers. `args` are the parts of the hash
 * after the view's name: #/parameters/feeder is show(root, context, "feeder"). `title` is a text,
 * or a function of args.
 *
 * The context:
 *   plant                 buses and drives from the overview's stream (plant.js)
 *   registers(drive)      promise of a Map of its registers by name; "" is the gateway
 *   commands(drive)       promise of a Map of its commands by name
 *   may(what, drive)      whether the user may stop, move, engineer (a drive), manage (the gateway)
 *                         or appoint (users), or read the audit trail; whyNot(what, drive) is the reason in words, or ""
 *   whyNotRun(command, drive)  the same for a command
 *   whyNotSee(drive)      the same for its health
 *   link()                live; late, hung, silent, lost, down (drivebridged) or connecting: the
 *                         values are old
 *   lateness()            how old the overview's values are at most because of the network, ms
 *   sayOld()              "" while the link is live; else in words how old the values are: "late by
 *                         4 s", "not known since 15:38:08"
 *   on(event, listener)   until the view is hidden, one of
 *                           "plant"     samples or figures arrived, at most some ten times a second
 *                           "describe"  drives or buses may have changed
 *                           "link"      with its state
 *                           "session"   with it
 *                           "frame"     each frame while the page is visible, with its time
 *   notify(text, kind)    a notice: info, ok, warning, error
 *   report(error)         an ApiError as a notice
 *   showAgain()           hides the view and shows it with the same arguments
 *   stop(drive, command)  stops a drive: stop, quick_stop or disable; repeats it until it is
 *                         confirmed, and shows it until then. A promise of { result }, of null when the user
 *                         gave it up
 */
import * as api from "./api.js";
import { element, icon, setAttribute, setText } from "./dom.js";
import { releaseHeld } from "./hold_button.js";
import { recall, remember } from "./kept_choice.js";
import { createPlant, NEED } from "./plant.js";
import { indexByName, inWords } from "./format.js";
import { sayLate } from "./lateness.js";
import * as login from "./login.js";
import * as overview from "./overview.js";
import { createStops } from "./stops.js";
import { dateTag, offerLanguages, t } from "./words.js";

/* Views with `nav` are in the navigation. */
const VIEWS = {
	"": { nav: t("Overview"), load: async () => overview },
	drive: { load: () => import("./drive.js") },
	commission: { load: () => import("./commission.js") },
	parameters: { nav: t("Parameters"), load: () => import("./parameters.js") },
	positions: { nav: t("Positions"), load: () => import("./positions.js") },
	scan: { nav: t("Scan"), load: () => import("./scan.js") },
	scope: { nav: t("Oscilloscope"), load: () => import("./scope.js") },
	trace: { nav: t("Trace"), load: () => import("./trace.js") },
	health: { nav: t("Health"), load: () => import("./health.js") },
	events: { nav: t("Events"), load: () => import("./events.js") },
	config: { nav: t("Config"), needs: "manage", load: () => import("./config.js") },
	gateway: { load: () => import("./gateway.js") },
	audit: { nav: t("Audit"), needs: "audit", load: () => import("./audit.js") },
	users: { nav: t("Users"), needs: "appoint", load: () => import("./users.js") },
	account: { load: () => import("./account.js") },
};
/* A tab in the background keeps its streams for this time. */
const ASLEEP_AFTER_MS = 10000;
const NOTICES_MOST = 4;
const OK_NOTICE_MS = 4000;
const WARNING_NOTICE_MS = 10000;
/* Time for drives to stand after a stop of all, before those that still move are named. */
const STAND_WITHIN_MS = 3000;

const find = (id) => document.getElementById(id);

const listeners = {
	plant: new Set(),
	describe: new Set(),
	link: new Set(),
	session: new Set(),
	frame: new Set()
};
let plant = createPlant();
let link = "connecting";
/* When the link was live the last time, as a Date; null: never. */
let knownAt = null;
let stream = null;
let registersByDrive = new Map();
let commandsByDrive = new Map();
let shown = { view: null, name: null, args: [], offs: [] };
let showing = 0;
let serviceUp = true;

function emit(event, ...args) {
	for (const listener of [...listeners[event]])
		listener(...args);
}

/* --- shared by views
 * --------------------------------------------------------------------------- */

function askOnce(known, drive, method, key) {
	if (!known.has(drive)) {
		const answer = api.call(method, { drive })
			.then((parameters) => indexByName(parameters[key]));

		known.set(drive, answer);
		answer.catch(() => known.delete(drive));
	}
	return known.get(drive);
}

const context = {
	get plant() { return plant; },
	registers: (drive) => askOnce(registersByDrive, drive, "Registers", "registers"),
	commands: (drive) => askOnce(commandsByDrive, drive, "Commands", "commands"),
	may: api.may,
	whyNot: api.whyNot,
	whyNotSee: api.whyNotSee,
	whyNotRun: api.whyNotRun,
	link: () => link,
	lateness: () => stream?.age() ?? 0,
	sayOld,
	on(event, listener) {
		listeners[event].add(listener);
		shown.offs.push(() => listeners[event].delete(listener));
	},
	notify,
	showAgain: () => showView(),
	report: (error) => notify(error.message, "error"),
	async stop(drive, command = "stop") {
		const answer = await stops.press(`${drive}: ${inWords(command)}`,
			{ method: "Run", parameters: { drive, command } });

		if (answer)
			notify(`${drive}: ${inWords(command)}: ${inWords(answer.result)}`, "ok");
		return answer;
	},
};

function notify(text, kind = "info") {
	const box = find("notices");
	const drawing = { ok: "fine", warning: "warning", error: "error" }[kind] ?? "hint";
	const close = element("button", { class: "quiet", type: "button", "aria-label": t("Dismiss") },
		icon("close"));
	const notice = element(
		"div", { class: `notice ${kind}` }, icon(drawing), element("p", {}, text), close);

	close.addEventListener("click", () => notice.remove());
	while (box.children.length >= NOTICES_MOST)
		box.firstChild.remove();
	box.append(notice);
	if (kind !== "error")
		setTimeout(() => notice.remove(),
			kind === "warning" ? WARNING_NOTICE_MS : OK_NOTICE_MS);
}

/* --- the plant -------------------------------------------------------------------------------- */

/* Registers of each family, for the names of states and errors. */
async function loadFamilies() {
	const now = plant;

	for (const bus of now.buses.values()) {
		const { protocol, drives } = bus.description;

		if (drives.length === 0 || now.families.has(protocol))
			continue;
		try {
			now.families.set(protocol, await context.registers(drives[0]));
		} catch {
			/* Tried again with the next description. */
		}
	}
	now.judge();
	if (now === plant) {
		emit("describe");
		emit("plant");
	}
}

function takeAnswer(answer, age) {
	if (answer.describe) {
		registersByDrive = new Map();
		commandsByDrive = new Map();
		plant.families = new Map();
		plant.describe(answer.describe);
		emit("describe");
		loadFamilies();
	}
	if (answer.samples)
		plant.take(answer.samples, performance.now(), age ?? 0);
	if (answer.figures)
		plant.takeFigures(answer.figures);
	if (answer.troubles)
		plant.takeTroubles(answer.troubles);
	showTitle();
	emit("plant");
}

function openOverview() {
	stream?.close();
	stream = api.openStream("overview", {}, {
		timed: true,
		onData: takeAnswer,
		onEvent(name, data) {
			if (name === "service") {
				serviceUp = data.up;
				if (!serviceUp)
					setLink("down");
			}
		},
		/* Several attempts to connect show the same state; without its service a gateway has
		 * no tokens to send. */
		onState(state) {
			if (!serviceUp && ["late", "hung"].includes(state))
				return;
			if (state !== "connecting" || link !== "lost")
				setLink(state === "failed" || state === "ended" ? "lost" : state);
		},
	});
}

/* --- the link's state ------------------------------------------------------------------------- */

const LINK_WORDS = {
	connecting: ["hint", t("connecting")],
	live: ["standstill", t("live")],
	late: ["warning", t("late")],
	hung: ["warning", t("service hangs")],
	silent: ["warning", t("silent")],
	lost: ["offline", t("no connection")],
	down: ["offline", t("service is down")],
};
const BANNER_WORDS = {
	late: t("The network is slow: what you see is old, and nothing can be jogged. Stops are sent at once."),
	hung: t("The gateway answers, but its service drivebridged says nothing."),
	silent: t("Nothing comes from the gateway any more."),
	lost: t("The connection to the gateway is lost; it comes back by itself. Drives that this page moves are stopped by their watchdog."),
	down: t("The service drivebridged does not answer; it comes back by itself."),
};

function sayOld() {
	if (link === "live")
		return "";
	if (link === "late")
		return sayLate(context.lateness());
	return knownAt ? t("not known since {time}", { time: knownAt.toLocaleTimeString(dateTag) }) : t("not known yet");
}

function setLink(state) {
	const node = find("link");

	if (state === link && node.firstChild)
		return;
	/* What stops being live was known until now. */
	if (link === "live")
		knownAt = new Date();
	link = state;
	node.dataset.state = state;
	node.replaceChildren(icon(LINK_WORDS[state][0]), element("span", {}, LINK_WORDS[state][1]));
	document.documentElement.classList.toggle("stale", state !== "live");
	showLink();
	showTitle();
	emit("link", state);
}

/* The words that change with time. */
function showLink() {
	const banner = find("banner");
	const words = api.getSession().role === "none" ? "" : BANNER_WORDS[link] ?? "";
	const old = sayOld();

	if (link === "late")
		setText(find("link").lastChild, old);
	banner.hidden = words === "";
	if (!words)
		return;
	if (banner.dataset.link !== link) {
		banner.dataset.link = link;
		banner.replaceChildren(icon("warning"), element("p", {}, words),
			element("strong", { "aria-live": "off" }));
	}
	setText(banner.lastChild, old && old.charAt(0).toUpperCase() + old.slice(1));
}

/* --- stop of all ------------------------------------------------------------------------------ */

function moving() {
	return [...plant.drives.values()]
		.filter((drive) => !["standstill", "disabled", "offline", "error"].includes(
				drive.judgement.shape))
		.map((drive) => drive.name);
}

/* One write stops all drives of all buses. If it fails, it does not tell for which drives: then
 * each is stopped by itself, and those that do not confirm it are named. */
async function stopAll() {
	const button = find("stop-all");
	const eachByItself = () => {
		const names = [...plant.drives.keys()];

		names.forEach((drive) => context.stop(drive));
		return names.length > 0;
	};

	button.classList.add("busy");
	/* What is held, or is about to move a drive, must not begin after the stop. */
	releaseHeld();
	const answer = await stops.press("all drives",
		{ method: "Write", parameters: { drive: "", values: { group_stop: 1 } } }, eachByItself);

	button.classList.remove("busy");
	if (answer)
		notify(t("Every drive was told to stop and has confirmed it"), "ok");
	setTimeout(() => {
		const names = moving();

		if (names.length > 0)
			notify(t("Still moving: {names}", { names: names.join(", ") }), "error");
	}, STAND_WITHIN_MS);
}

/* --- stops that are not confirmed ------------------------------------------------------------- */

const stops = createStops({
	send: ({ method, parameters }) => api.call(method, parameters),
	onChange: showUnconfirmed,
});

function isBraking({ call, since }) {
	const drive = plant.drives.get(call.parameters.drive);

	return link === "live" && drive?.judgement.shape === "stopping" && drive.heardAt > since &&
		performance.now() - drive.heardAt < api.SILENT_AFTER_MS;
}

function showUnconfirmed(late) {
	const box = find("stop-alarm");
	const braking = late.length > 0 && late.every(isBraking);
	const oldest = Math.min(...late.map(({ since }) => since));

	box.hidden = late.length === 0;
	if (late.length === 0) {
		box.hidePopover?.();
		return;
	}
	box.showPopover?.();
	setAttribute(box, "data-kind", braking ? "braking" : "unconfirmed");
	setText(find("stop-alarm-words"), braking ? t("Braking, not standing yet") :
		t("Stop NOT CONFIRMED: use the emergency stop"));
	setText(find("stop-alarm-names"), late.map(({ name, why }) => `${name}${why ? ` (${why})` : ""}`)
		.join(", "));
	setText(find("stop-alarm-time"), t("for {seconds} s; it is sent again until it is confirmed", { seconds: Math.floor((performance.now() - oldest) / 1000) }));
}

/* --- the shell's head ------------------------------------------------------------------------- */

function showNavigation() {
	const list = element("ul");

	for (const [name, view] of Object.entries(VIEWS)) {
		if (view.nav)
			list.append(element("li", {},
				element("a", { href: `#/${name}`, "data-view": name }, view.nav)));
	}
	showRights();
	find("navigation").append(list);
}

function markNavigation(name) {
	for (const anchor of find("navigation").querySelectorAll("a")) {
		if (anchor.dataset.view === name)
			setAttribute(anchor, "aria-current", "page");
		else
			anchor.removeAttribute("aria-current");
	}
}

/* What may not be done is not offered. */
function showRights() {
	find("stop-all").hidden = !api.may("stop");
	/* Without a login each of them would lead back to it. */
	find("navigation").hidden = api.getSession().role === "none";
	for (const anchor of find("navigation").querySelectorAll("a")) {
		const { needs } = VIEWS[anchor.dataset.view];

		anchor.parentElement.hidden = Boolean(needs) && !api.may(needs);
	}
}

function showUser() {
	const { user, role } = api.getSession();
	const box = find("user");

	showRights();
	find("link").hidden = role === "none";
	if (user) {
		const out = element("button", {
			id: "logout",
			class: "quiet",
			type: "button",
			"aria-label": t("Log out"),
			title: t("Log out {user}", { user })
		},
			icon("logout"));

		out.addEventListener("click", async () => {
			try {
				await api.logOut();
			} catch (error) {
				context.report(error);
			}
		});
		box.replaceChildren(icon("user"),
			element("a", { class: "user-name", id: "account-link", href: "#/account",
				title: t("What you may do, and your password") },
				user, element("small", {}, t(role))),
			out);
	} else if (role !== "none") {
		box.replaceChildren(element("a", { id: "login-link", href: "#/login" }, t("Log in")));
	} else {
		box.replaceChildren();
	}
}

const THEMES = {
	auto: t("as the system"),
	light: t("light"),
	dark: t("dark")
};

function setTheme(theme) {
	const button = find("theme");

	if (theme === "auto")
		delete document.documentElement.dataset.theme;
	else
		document.documentElement.dataset.theme = theme;
	remember("theme", theme);
	button.replaceChildren(icon("theme"));
	setAttribute(button, "aria-label", t("Colours: {theme}", { theme: THEMES[theme] }));
	setAttribute(button, "title", t("Colours: {theme}", { theme: THEMES[theme] }));
	button.dataset.theme = theme;
	window.dispatchEvent(new Event("themechange"));
}

function startTheme() {
	const names = Object.keys(THEMES);
	const theme = recall("theme", "auto");

	setTheme(names.includes(theme) ? theme : "auto");
	find("theme").addEventListener("click",
		() => setTheme(
			names[(names.indexOf(find("theme").dataset.theme) + 1) % names.length]));
}

/* --- routes ----------------------------------------------------------------------------------- */

function readHash() {
	const parts = location.hash.replace(/^#\/?/, "").split("/").map((part) => {
		try {
			return decodeURIComponent(part);
		} catch {
			return part;
		}
	});

	return { name: parts[0] ?? "", args: parts.slice(1).filter((part) => part !== "") };
}

async function pickView(name) {
	const { role, user } = api.getSession();

	if (role === "none" || (name === "login" && !user))
		return login;
	return VIEWS[name] ? VIEWS[name].load() : null;
}

/* The number of drives that need somebody is also visible in a background tab's title. */
function showTitle() {
	const { drives, buses, configuration } = plant.countNeeds();
	const count = drives[NEED.act] + buses[NEED.act] + configuration[NEED.act];
	const mark = link === "live" || link === "connecting" ? "" : "✕ ";
	const title = `${mark}${count > 0 ? `(${count}) ` : ""}${shown.title ?? ""} – drivebridge`;

	if (document.title !== title)
		document.title = title;
}

async function showView() {
	const { name, args } = readHash();
	const turn = ++showing;
	const main = find("main");
	const root = element("div", { class: "view", "data-view": name || "overview" });
	let view = null;
	let problem = t("There is no such page.");

	try {
		view = await pickView(name);
	} catch (error) {
		problem = t("This part of the page could not be loaded: {message}", { message: error.message });
	}
	if (turn !== showing)
		return;
	shown.view?.hide();
	shown.offs.forEach((off) => off());
	shown = { view, name, args, offs: [] };
	main.replaceChildren(root);
	markNavigation(view === login ? "login" : name);
	shown.title = view?.title ?? t("Not found");
	if (typeof shown.title === "function")
		shown.title = shown.title(...args);
	showTitle();
	scrollTo(0, 0);
	if (!view) {
		root.append(element("p", { class: "empty" }, problem));
		return;
	}
	try {
		await view.show(root, context, ...args);
	} catch (error) {
		if (turn !== showing)
			return;
		root.replaceChildren(element("p", { class: "empty" }, error.message));
		/* When drivebridged is connected again, or has added the drive. */
		context.on("describe", showView);
	}
}

/* --- the start -------------------------------------------------------------------------------- */

function takeSession(session, before) {
	showUser();
	if (api.hasOtherRights(session, before)) {
		if (session.user && session.password.weak)
			notify(t("Your password is weak: {weak}. Change it under your name.", { weak: session.password.weak }),
				"warning");
		stream?.close();
		stream = null;
		serviceUp = true;
		knownAt = null;
		setLink("connecting");
		plant = createPlant();
		registersByDrive = new Map();
		commandsByDrive = new Map();
		if (session.role !== "none")
			openOverview();
		if (location.hash === "#/login" && session.user)
			location.hash = "#/";
		showView();
	}
	showLink();
	emit("session", session);
}

function watchVisibility() {
	let timer = 0;

	document.addEventListener("visibilitychange", () => {
		clearTimeout(timer);
		if (!document.hidden)
			api.setAsleep(false);
		else if (!api.hasActed())
			timer = setTimeout(() => api.setAsleep(true), ASLEEP_AFTER_MS);
	});
}

function runFrames() {
	const frame = (now) => {
		if (link !== "live")
			showLink();
		emit("frame", now);
		requestAnimationFrame(frame);
	};

	requestAnimationFrame(frame);
}

async function loadSession() {
	try {
		const session = await api.loadSession();

		/* The listener only reports changes; without a login the first session is no
		 * change. */
		if (session.role === "none")
			showView();
	} catch (error) {
		find("main").replaceChildren(
			element("p", { class: "empty" }, error.message, t("; trying again")));
		setTimeout(loadSession, 2000);
	}
}

function start() {
	const stop = find("stop-all");

	/* What is written in index.html. */
	setText(find("skip"), t("To the content"));
	setText(find("stop-alarm-dismiss"), t("I have seen to it"));
	setAttribute(find("navigation"), "aria-label", t("Pages"));
	setText(find("language-label"), t("Language"));
	offerLanguages(find("language"));
	showNavigation();
	startTheme();
	stop.append(icon("stop"), element("span", {}, t("Stop all")));
	setAttribute(stop, "aria-keyshortcuts", "Control+.");
	setAttribute(stop, "title", t("Every drive of every bus stops (Ctrl+.)"));
	stop.addEventListener("click", stopAll);
	find("stop-alarm-icon").replaceWith(icon("warning"));
	find("stop-alarm-dismiss").addEventListener("click", () => stops.giveUp());
	window.addEventListener("keydown", (event) => {
		if (event.key === "." && event.ctrlKey && !event.repeat && !stop.hidden) {
			event.preventDefault();
			stopAll();
		}
	}, true);
	/* Screen readers follow to the new view. */
	window.addEventListener("hashchange", async () => {
		await showView();
		if (!find("main").contains(document.activeElement))
			find("main").focus({ preventScroll: true });
	});
	window.addEventListener("beforeprint", () => setText(find("printed"),
		t("{host}, printed {time}", { host: location.host, time: new Date().toLocaleString(dateTag) }) +
		(link === "live" ? "" : `; ${sayOld()}`)));
	watchVisibility();
	api.onSession(takeSession);
	api.startApi();
	setLink("connecting");
	runFrames();
	loadSession();
}

start();
