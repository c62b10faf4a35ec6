/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives' side of a serial line as it was recorded by drivebridgectl trace: what is asked as in the file is answered
 * with the bytes and after the time that are there. So a trace from the field becomes a test.
 *
 * Questions are expected in the order of the file. One that comes out of its turn, such as a poll while a command is
 * waited for, is answered as it last was before that place; when it was not asked before, as it first is behind it, and
 * then that was its turn. One that is nowhere in the file gets no answer. Both are told with the line that was
 * expected. No I/O but for what is told.
 */
#ifndef DRIVEBRIDGE_SIM_REPLAY_H
#define DRIVEBRIDGE_SIM_REPLAY_H

#include "sim/wire.h"

#include <stdbool.h>
#include <stdio.h>

struct sim_replay;

/* A trace from its text. On failure null, and what is wrong was written to `told` as "file:line: ...". What happens
 * while it is replayed is written there, too; it must outlive the replay. */
struct sim_replay *sim_replay_parse(const char *text, const char *file, FILE *told);

/* Writes down what goes over the wire. */
void sim_replay_set_trace(struct sim_replay *replay, sim_trace_fn *trace, void *context);

/* The same from a file. */
struct sim_replay *sim_replay_load(const char *path, FILE *told);
void sim_replay_free(struct sim_replay *replay);

/* Whether all of the file was asked for in turn, and nothing that is not there. */
bool sim_replay_is_complete(const struct sim_replay *replay);
/* One line: how much of it was asked for. */
void sim_replay_tell(const struct sim_replay *replay);

/* For the world, whose wire it is. */
extern const struct sim_wire_ops sim_replay_ops;

#endif
