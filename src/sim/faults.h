/* SPDX-License-Identifier: Apache-2.0 */
/* Faults on the wire, by request: which one and how often. Pure data; one thread. */
#ifndef DRIVEBRIDGE_SIM_FAULTS_H
#define DRIVEBRIDGE_SIM_FAULTS_H

#include <stdbool.h>
#include <stdint.h>

enum sim_fault {
	SIM_FAULT_DROP,         /* carried out, not answered */
	SIM_FAULT_LOSE_REQUEST, /* neither carried out nor answered */
	SIM_FAULT_DELAY,        /* answered late */
	SIM_FAULT_CORRUPT,      /* one bit of the reply flipped */
	SIM_FAULT_CORRUPT_AT,   /* one bit of a chosen byte of the reply, serial lines only */
	SIM_FAULT_TRUNCATE,     /* the reply's second half is missing */
	SIM_FAULT_GARBAGE,      /* random bytes, FF among them, before the reply */
	SIM_FAULT_SPLIT,        /* the same in the middle of the reply, serial lines only */
	SIM_FAULT_DOUBLE,       /* the reply comes twice */
	SIM_FAULT_WRONG_ID,     /* a valid reply in another drive's name */
	SIM_FAULT_SILENCE,      /* on or off: as if unplugged from the bus, but powered */
	SIM_FAULT_ECHO,         /* on or off, bus only: the host receives what it sends */
	SIM_FAULT_BUS_OFF,      /* on or off, CAN only: the host's controller is off the bus */
	SIM_FAULT_RUNAWAY,      /* on or off, VSMD only: stops are acknowledged without effect */
	SIM_FAULT_LOSE_END,     /* the request's last byte is lost, bus of serial lines only */
	SIM_FAULT_COUNT
};

struct sim_faults {
	int32_t left[SIM_FAULT_COUNT]; /* remaining occurrences; -1: until cleared */
	uint32_t delay_ms;
	/* number of the byte, from 1; counted modulo the length of a shorter reply */
	uint32_t corrupt_at;
};

/*
 * Reads "drop", "drop 3", "delay 200", "delay 200 3", "corrupt-at 3 1", "silence on", "echo off",
 * "none" ... and changes *faults. Null, or the mistake (a static text) with *faults unchanged.
 */
const char *sim_faults_set(struct sim_faults *faults, const char *text);

/* True if the fault happens now; counts it. */
bool sim_faults_take(struct sim_faults *faults, enum sim_fault fault);

/* The names that sim_faults_set() knows, for messages. */
#define SIM_FAULT_NAMES                                                                      \
	"drop, lose-request, delay, corrupt, corrupt-at, truncate, garbage, split, double, " \
	"wrong-id, silence, echo, bus-off, runaway, lose-end, none"

#endif
