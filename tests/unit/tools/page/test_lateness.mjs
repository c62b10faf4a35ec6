/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { createLateness, isLate, sayLate } from "../../../../src/tools/web/page/lateness.js";

/* A gateway whose clock is 100000 ms ahead of the page's. */
const AHEAD = 100000;

test("no age is known before the gateway has answered", () => {
	const lateness = createLateness();

	assert.equal(lateness.ageOf(AHEAD, 0), null);
	lateness.takeTrip(0, undefined);
	assert.equal(lateness.isKnown(), false);
});

test("values that took four seconds are at least four seconds old", () => {
	const lateness = createLateness();

	/* 30 ms to the gateway. */
	lateness.takeTrip(1000, 1030 + AHEAD);
	assert.equal(lateness.ageOf(5000 + AHEAD, 9000), 4030);
	/* A shorter trip says more, a longer one says nothing. */
	lateness.takeTrip(2000, 2005 + AHEAD);
	lateness.takeTrip(3000, 6000 + AHEAD);
	assert.equal(lateness.ageOf(5000 + AHEAD, 9000), 4005);
	assert.equal(lateness.ageOf(9010 + AHEAD, 9000), 0);
});

test("the shortest trip outlives many longer ones, and not for ever", () => {
	const lateness = createLateness();

	lateness.takeTrip(0, 5 + AHEAD);
	for (let at = 1000; at < 100000; at += 1000)
		lateness.takeTrip(at, at + 500 + AHEAD);
	assert.equal(lateness.ageOf(AHEAD + 1000, 1000), 5);
	lateness.takeTrip(130000, 130300 + AHEAD);
	assert.equal(lateness.ageOf(AHEAD + 130000, 130000), 300);
});

test("a page whose clock stood still knows nothing until it has asked again", () => {
	const lateness = createLateness();

	lateness.takeTrip(0, 5 + AHEAD);
	lateness.takeMoment(1000 + AHEAD, 1000);
	assert.equal(lateness.isKnown(), true);
	/* The computer slept for a minute. */
	lateness.takeMoment(62000 + AHEAD, 2000);
	assert.equal(lateness.isKnown(), false);
	lateness.takeTrip(2100, 62110 + AHEAD);
	assert.equal(lateness.ageOf(62100 + AHEAD, 2200), 110);
});

test("values are late above a second, and in time again well below it", () => {
	assert.deepEqual([[1000, false], [1001, false], [900, true], [700, true], [null, true]]
		.map(([age, before]) => isLate(age, before)), [false, true, true, false, false]);
	assert.deepEqual([1240, 4030, 12400].map(sayLate), ["late by 1.2 s", "late by 4 s", "late by 12 s"]);
});
