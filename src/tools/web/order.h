/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A page numbers its acting calls, each higher than the one before. They arrive over several
 * connections, so in any order, and a browser repeats one by itself when its connection breaks.
 * Each is carried out at most once, and none after a stop that was pressed after it.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_WEB_ORDER_H
#define DRIVEBRIDGE_WEB_ORDER_H

#include <stdbool.h>
#include <stdint.h>

/* A call this far below the highest number is not carried out. */
#define DB_WEB_ORDER_WINDOW 64

struct db_web_order {
	uint64_t highest; /* 0: there was none */
	uint64_t seen;    /* bit i: highest - i has arrived */
	uint64_t stopped; /* the highest number of a stop */
};

enum db_web_turn {
	DB_WEB_TURN_NOW,
	DB_WEB_TURN_REPEATED,  /* it has arrived before, or may have */
	DB_WEB_TURN_OVERTAKEN, /* by a stop */
};

/* A call has arrived; numbers from 1. */
enum db_web_turn db_web_order_take(struct db_web_order *order, uint64_t number);

/* A stop has arrived; 0: without a number. */
void db_web_order_stop(struct db_web_order *order, uint64_t number);

static inline bool db_web_order_is_overtaken(const struct db_web_order *order, uint64_t number)
{
	return number < order->stopped;
}

#endif
