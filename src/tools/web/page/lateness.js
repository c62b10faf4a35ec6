/* SPDX-License-Identifier: Apache-2.0 */
import { formatFixed } from "./format.js";
import { t } from "./words.js";
/*
 * How old the values on the screen are because of the network. The gateway writes into each event
 * the moment of its own clock; what that clock shows now at most follows from calls that it answers
 * with its moment: the answer was written after the call was sent. So the age of an event is never
 * shown as less than it is, and no clock of this computer is compared with one of the gateway.
 *
 * Pure; times are milliseconds of one clock of this page, moments are milliseconds of the gateway's.
 */

/* Calls from before this time are forgotten: the two clocks do not run quite alike. */
const TRIPS_FOR_MS = 120000;
const TRIPS_MOST = 16;
/* The clocks do not differ by more than this by themselves in TRIPS_FOR_MS. */
const AMISS_MS = 250;
/* Above this, values are old. */
export const LATE_MS = 1000;
/* Values that were late are in time again below this. */
const IN_TIME_MS = 700;

export function createLateness() {
	let trips = [];

	const ahead = () => Math.min(...trips.map((trip) => trip.ahead));

	return {
		/* The gateway has answered a call that was sent at `sentAt` with its moment. */
		takeTrip(sentAt, moment) {
			if (typeof moment !== "number")
				return;
			trips = trips.filter((trip) => sentAt - trip.sentAt < TRIPS_FOR_MS);
			trips.push({ sentAt, ahead: moment - sentAt });
			/* The shortest one and the latest ones. */
			if (trips.length > TRIPS_MOST) {
				const best = ahead();
				const first = trips.findIndex((trip) => trip.ahead > best);

				trips.splice(first < 0 ? 0 : first, 1);
			}
		},
		/* An event of this moment has come. A moment from the future means that this page's
		 * clock stood still, or that the gateway has started again: nothing is known then. */
		takeMoment(moment, now) {
			if (trips.length > 0 && (moment > now + ahead() + AMISS_MS ||
				moment < now + ahead() - 3600000))
				trips = [];
		},
		/* The longest time that an event of this moment can be old; null: not known yet. */
		ageOf: (moment, now) =>
			(trips.length === 0 || typeof moment !== "number" ? null :
				Math.max(0, now + ahead() - moment)),
		isKnown: () => trips.length > 0,
	};
}

/* Whether values of this age are late, if those before them were or were not. */
export function isLate(age, before) {
	return age !== null && age > (before ? IN_TIME_MS : LATE_MS);
}

/* "late by 4 s" */
export function sayLate(age) {
	return t("late by {seconds} s", { seconds: formatFixed(age / 1000, age < 2000 ? 1 : 0) });
}
