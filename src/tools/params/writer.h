/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes parameters into a drive, in the order of db_params_order(), each read back, and all of
 * them once more at the end: something else may have written them meanwhile. It says which call
 * comes next and takes the answer; whoever owns the connection makes the call. Pure.
 *
 *	while ((method = db_params_writer_next(&writer, &parameters)))
 *		... call it ...
 *		db_params_writer_take(&writer, answer, &error);
 */
#ifndef DRIVEBRIDGE_PARAMS_WRITER_H
#define DRIVEBRIDGE_PARAMS_WRITER_H

#include "client/error.h"

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

struct db_params_writer {
	/* Set by the caller, and valid until the end: */
	const char *drive;
	const json_t *registers;
	const json_t *values; /* to be written, by name */
	const json_t *plan;   /* of db_params_order() */
	/* Names of values that the drive has already, which are read at the end, too; NULL. */
	json_t *kept;
	bool standing; /* nothing is written any more once the drive moves */
	/* What becomes of a parameter: `state` is writing, done or failed, `text` the result or
	 * the reason, `value` what the drive then has, NULL: not known. */
	void (*report)(void *data, const char *name, const char *state, const char *text,
	               const json_t *value);
	void *data;
	/* The outcome: */
	json_t *written; /* names */
	json_t *failed;  /* reasons by name */
	char over[512];  /* why nothing more can be written, "" */
	bool lost;       /* it is over because the connection is lost */
	bool for_good;   /* it is over, and would be again: the service does not know this call */
	bool changed;    /* something else has written parameters meanwhile */
	bool reads_back; /* the next call reads what the last one has written */
	/* Private: */
	size_t at; /* in the plan */
	bool again;
	bool checks; /* the next answer is that of the last read */
	bool checked;
	char result[64]; /* of the write that is read back */
};

/* Without a plan there is nothing to write. To be cleared. */
void db_params_writer_begin(struct db_params_writer *writer);
void db_params_writer_clear(struct db_params_writer *writer);

/* The method and the parameters of the next call, which the caller frees. NULL: it has ended. */
const char *db_params_writer_next(struct db_params_writer *writer, json_t **parameters);

/* How that call ended: with an answer, or NULL and the error. */
void db_params_writer_take(struct db_params_writer *writer, const json_t *answer,
                           const struct db_client_error *error);

/* Between two calls: nothing more is written, and the next parameter has failed for this reason.
 * What is written is still read back. Without effect after the last one. */
void db_params_writer_end(struct db_params_writer *writer, const char *why);

/* Afterwards: the names of the plan that were not tried any more. The caller frees them. */
json_t *db_params_writer_untried(const struct db_params_writer *writer);

/* The number of parameters in the plan. */
size_t db_params_plan_size(const json_t *plan);

#endif
