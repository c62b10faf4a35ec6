/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records of a trace and of the audit trail in the language of the page. The service and the gateway's files have them
 * in English, put together from these texts; a part that is none of them stays as it is: names, numbers, bits.
 */
import { inWords } from "./format.js";
import { createWords, inLanguage, languageTag, t } from "./words.js";

/* Marks a text for po/: it is translated when the first record is said. */
const form = (english) => english;

/* What frames mean, with their values, as src/common/codec/..._describe.c writes it. */
export const FRAMES = [
	form("identity?"), form("status?"), form("enable"), form("disable"), form("clear the encoder error"), form("start homing"),
	form("stop homing"), form("stop to and fro"), form("start to and fro"), form("parameters?"), form("save parameters"),
	form("turn"), form("stop"), form("stop at once"), form("move to %ld pulses"), form("move by %ld pulses"),
	form("the position is %ld pulses"), form("the position is %ld counts"), form("the position is %s"), form("the position is 0"),
	form("position %ld pulses"), form("position %ld counts"), form("velocity %s"), form("status %s"), form("output s%u %s"),
	form("output P%u %s"), form("output %s%u to %u"), form("all outputs %s"), form("on"), form("off"),
	form("to and fro from %ld to %ld pulses"), form("to and fro from %ld pulses"), form("to and fro to %ld pulses"),
	form("to and fro"), form("%lu times"), form("identity \"%s\""), form("identity, a part: \"%s\""), form("report %s"),
	form("report %s every %u ms"), form("report velocity, position and status every %u ms"),
	form("report velocity, position and status"), form("nothing"), form("none"), form("velocity, position and status"), form("position and status"),
	form("the position"), form("velocity, position and status?"), form("position and status?"),
	form("parameters in registers %02X to %02X?"), form("status registers %02X to %02X?"),
	form("status register %02X is %08lX"), form("register %02X is %08lX"), form("bit %u"),
	form("are you there?"), form("position without its sign?"), form("sign of the position?"), form("does it stand?"),
	form("inputs and outputs?"), form("stop the program at once"), form("pause the program"), form("continue the program"),
	form("end the program"), form("single steps on"), form("single steps off"), form("state of the program?"),
	form("the position without its sign is %lu pulses"), form("position without its sign %lu pulses"), form("positive"),
	form("negative"), form("jog backward"), form("jog forward"), form("start program %u"), form("programs start after %u s"),
	form("class %02X target %02X is %08lX"), form("it stands"), form("it moves"), form("inputs %04X"), form("outputs %04X"),
	form("inputs %02X"), form("outputs %02X"), form("question"), form("read or write"), form("manual command"),
	form("program command"), form("an order"), form("I am here"), form("%s accepted"), form("%s refused"),
	form("program %u idle"), form("program %u running"), form("program %u waiting"), form("program %u interrupted"),
	form("program %u in state %u"), form("instruction %u"),
	form("position"), form("position?"), form("speed and current"), form("speed and current?"), form("analogue"),
	form("analogue?"), form("status"), form("mode"), form("speed"), form("current"), form("set position"), form("ramps"),
	form("acknowledges %s"), form("measured %s"), form("sync"), form("mode %s"), form("torque clockwise"),
	form("at most %u rpm"), form("speed %d rpm"), form("current %s"), form("internal position %u is %ld counts"),
	form("acceleration %lu rpm/s"), form("deceleration %lu rpm/s"), form("command word 1 %s"), form("command words %s"),
	form("move"), form("target %lld steps"), form("analogue input 1 is %u"), form("supply voltage raw %u"),
	form("temperature raw %u"), form("faults %s"), form("no answer"), form("address %u"), form("all drives"),
];

/* What was done, as records of the audit trail have it, besides commands; and their texts. */
const DEEDS = [
	form("taken"), form("released"), form("write"), form("asked for"), form("changed"), form("acknowledged"), form("ended"),
	form("begins"), form("ends"), form("in"), form("out"), form("backup"), form("added"), form("removed"), form("scan"),
	form("address"), form("speed"), form("save"), form("taught"), form("forgotten"), form("not gone to"), form("put"),
	form("password"), form("a signal of process %u, user %u"), form("alarm %llu: %s"), form("denied to all clients"), form("of all kinds"),
	form("addresses %u to %u"), form("addresses %u to %u, with the bus out of service"), form("the drive at address %u"),
	form("the drive at address %u: %u"), form("they came faster than they could be written"),
	form("the disk did not take them"), form("only root and members of act-group may act"),
	form("a torn record of %llu bytes at the end was cut off"),
];

export const TRACE_KINDS = {
	stop: t("stop"), poll: t("poll"), identify: t("identify"), probe: t("probe"), command: t("command"),
	broadcast: t("broadcast"), answer: t("answer"), part: t("part"), report: t("report"), late: t("late"), stray: t("stray"),
	bad: t("bad"), foreign: t("foreign"), garbage: t("garbage"), unanswered: t("unanswered"), event: t("event"),
	missing: t("missing"),
};

export const AUDIT_KINDS = { "command": t("command"), "write": t("write"), "end": t("end"), "control": t("control"),
	"denied": t("denied"), "reload": t("reload"), "set-up": t("set-up"), "login": t("login"),
	"users": t("users"), "service": t("service"), "repeated": t("repeated"), "lost": t("lost"),
	"trail": t("trail"), "alarm": t("alarm"), "position": t("position") };

/* The speed of a motion and its unit, at the end of what it says. */
const SPEED = /^(.+) at ([-+.\deinfa]+ (?:pulses\/s|Hz))$/;
const TOOK = /^(.*) \(([\d.]+) ms\)$/s;
const UNANSWERED = /^no answer to "(.*)" within ([\d.]+) ms$/s;

/* sayFrame for one language, from its t(). Pure. */
export function createFrames(t) {
	const speak = (texts) => createWords(new Map(texts.map((text) => [text, t(text)]))).inLanguage;
	/* A comma is within one of these, or between two. */
	const sayWhole = speak(FRAMES.filter((text) => text.includes(", ")));
	const sayOne = speak(FRAMES);

	function sayBody(body) {
		const whole = sayWhole(body);
		const speed = body.match(SPEED);

		if (whole !== body)
			return whole;
		if (body.startsWith("set "))
			return t("set: {values}", { values: body.slice(4) });
		if (body.includes(", "))
			return body.split(", ").map(sayBody).join(", ");
		return speed ? t("{what} at {speed}", { what: sayBody(speed[1]), speed: speed[2] }) : sayOne(body);
	}

	/* "feeder: stop at once (3.4 ms)" */
	return function sayFrame(text) {
		const [, told, ms] = text.match(TOOK) ?? ["", text, ""];
		const [, who, body] = told.match(/^(\S+|address \d+|all drives): (.*)$/s) ?? ["", "", told];
		const unanswered = body.match(UNANSWERED);
		const said = unanswered ?
			t("no answer to \"{words}\" within {ms} ms", { words: sayBody(unanswered[1]), ms: unanswered[2] }) :
			sayBody(body);

		return `${who ? `${sayOne(who)}: ` : ""}${said}${ms ? ` (${ms} ms)` : ""}`;
	};
}

const isEnglish = languageTag === "en";
const sayFrame = isEnglish ? (text) => text : createFrames(t);
const deeds = isEnglish ? null : createWords(new Map(DEEDS.map((text) => [text, t(text)])));

/* The words of a record of a trace. */
export function sayTrace(words) { return sayFrame(words); }

/* The line of a record of the audit trail; see src/tools/capture/audit_text.c. */
export function sayAudit(record) {
	const { kind, what = "", text = "" } = record;
	const say = (words) => {
		const found = deeds.inLanguage(words);

		return found !== words ? found : inLanguage(words);
	};
	const parts = [];

	if (isEnglish)
		return record.line;
	if (kind === "command")
		parts.push(inWords(what));
	else
		parts.push(`${AUDIT_KINDS[kind] ?? kind}${what ? `: ${say(what.replaceAll("_", " "))}` : ""}`);
	for (const [name, value] of Object.entries(record.arguments ?? {}))
		parts.push(`${name}=${JSON.stringify(value)}`);
	for (const [name, [old, now]] of Object.entries(record.values ?? {}))
		parts.push(`${name} ${JSON.stringify(old ?? null)} → ${JSON.stringify(now ?? null)}`);
	if (record.register !== undefined)
		parts.push(t("register {number}", { number: record.register }));
	if (record.unit !== undefined)
		parts.push(t("unit {number}", { number: record.unit }));
	if (record.endpoint)
		parts.push(t("endpoint {endpoint}", { endpoint: record.endpoint }));
	if (record.count !== undefined)
		parts.push(t("{count} times", { count: record.count }));
	if (record.of !== undefined)
		parts.push(t("(of {number})", { number: record.of }));
	return `${parts.join(" ")}${text ? `${what ? "," : ""} ${say(text)}` : ""}`;
}
