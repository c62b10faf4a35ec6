/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives' side of a serial line as recorded by drivebridgectl trace: a question of the file is
 * answered with the bytes recorded there, after the same time. So a trace from the field becomes a
 * test.
 *
 * Questions are expected in the order of the file. A question out of turn, such as a poll while a
 * command is expected, gets its last answer before the expected place; if it was not asked before,
 * it gets its first answer after that place, and then that was its turn. A question that is not in
 * the file gets no answer. Both are reported with the expected line. No I/O but for these reports.
 */
#ifndef DRIVEBRIDGE_SIM_REPLAY_H
#define DRIVEBRIDGE_SIM_REPLAY_H

#include "sim/wire.h"

#include <stdbool.h>
#include <stdio.h>

struct sim_replay;

/* Parses the text of a trace. Null on failure, and the mistake is written to `log` as "file:line:
 * ...". Reports during the replay are written there too; it must outlive the replay. */
struct sim_replay *sim_replay_parse(const char *text, const char *file, FILE *log);

/* The same from a file. `trace` receives the traffic of the wire; it may be null. */
struct sim_replay *sim_replay_load(const char *path, FILE *log, sim_trace_fn *trace, void *context);
/* `wire` is a struct sim_replay, or null. */
void sim_replay_free(void *wire);

/* True if all of the file was asked in turn, and nothing else. */
bool sim_replay_is_complete(const struct sim_replay *replay);
/* Writes one line: how much of it was asked. */
void sim_replay_report(const struct sim_replay *replay);

/* For the world that owns the wire. */
extern const struct sim_wire_ops sim_replay_ops;

#endif
