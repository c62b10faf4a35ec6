/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Parameters in groups, and choices in words, from the descriptions that the service gives: those
 * name what a parameter is about, and what its values mean. Pure.
 */
import { hasBits, inWords } from "./format.js";
import { hasTrait } from "./parameter_set.js";
import { inLanguage, t } from "./words.js";

/* In this order; the first one that fits. */
const GROUPS = [
	{ name: t("Communication"), fits: (register) => hasTrait(register, "address"),
		words: /\b(address|baud|bit rate|station|node)\b/i },
	{ name: t("Homing and origin"), words: /\b(homing|home|origin)\b|^safe position/i },
	{ name: t("Encoder and control loop"),
		words: /\b(encoder|loop|gain|stall|filter|closed loop)\b/i },
	{ name: t("Inputs, outputs and limits"),
		words: /\b(sensors?|inputs?|outputs?|ports?|limit|emergency|alarm)\b/i },
	{ name: t("Current and power"), fits: ({ unit }) => /^(m?A|m?V|W|°C|%)$/.test(unit),
		words: /\b(current|voltage|power|torque|temperature|enable the motor)\b/i },
	{ name: t("Motion"), fits: ({ unit }) => /pulses|counts|rpm|\/s/.test(unit ?? ""),
		words: /\b(speed|velocity|accelerat\w*|decelerat\w*|position|microstep\w*|steps?|direction|jog)\b/i },
];
const OTHER = t("Other");

export const GROUP_NAMES = [t("Motion"), t("Current and power"), t("Homing and origin"),
	t("Inputs, outputs and limits"), t("Encoder and control loop"), t("Communication"), OTHER];

export function groupOf(register) {
	/* What its values mean is not what it is about. */
	const [about] = (register.description ?? "").split(/\s\d+=/);

	return GROUPS.find(({ fits, words }) => fits?.(register) || words.test(about))?.name ?? OTHER;
}

/* Values of which people choose one in words; more of them are typed. */
const CHOICES_MOST = 32;

/*
 * The choices of a parameter as [[number, words]]; null if its description does not say what each of
 * its values means: "Homing mode: 0=off 1=once".
 */
export function readChoices(register) {
	if (hasBits(register) || register.type === "f32" || register.type === "text")
		return null;
	const codes = Object.entries(register.codes ?? {});

	if (codes.length > 0)
		return codes.map(([number, name]) => [Number(number), inWords(name)]);
	const { min, max } = register;
	const description = inLanguage(register.description);
	const found = new Map([...description.matchAll(/(?:^|\s)(\d+)=(.+?)(?=\s+\d+=|;|$)/g)]
		.map(([, number, words]) => [Number(number), words.trim()]));

	if (!(max - min >= 1 && max - min < CHOICES_MOST))
		return null;
	for (let value = min; value <= max; value++) {
		/* "1=s1 ... 6=s6" leaves out some. */
		if (!found.has(value) || found.get(value).includes("..."))
			return null;
	}
	return [...found].filter(([value]) => value >= min && value <= max);
}
