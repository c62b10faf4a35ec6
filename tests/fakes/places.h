/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The places of a bus that carries nothing out: requests stay in them until a test ends them. One
 * thread; zeroed memory is free.
 */
#ifndef DRIVEBRIDGE_FAKES_PLACES_H
#define DRIVEBRIDGE_FAKES_PLACES_H

#include "drivebridge/command.h"

struct fake_place {
	struct db_request request;
	struct db_args args;
	struct db_setting settings[DB_SETTINGS_MAX];
	bool used;
};

/* As the queue of a bus: the copy with its arguments or settings; null: all are used. */
struct db_request *fake_place_fill(struct fake_place *places, size_t count,
                                   const struct db_request *request);
/* The request with this ticket; null: it is in none of the places. */
struct db_request *fake_place_find(struct fake_place *places, size_t count, uint32_t ticket);
/* Ends it; returns it. */
struct db_request *fake_place_end(struct db_request *request, enum db_result result, db_time now);
/* Frees the place of this request; ignores one that is in none of them. */
void fake_place_release(struct fake_place *places, size_t count, const struct db_request *request);

#endif
