/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Gives a drive another address, or the speed of another bus: looks, asks the user, sets, saves,
 * and looks for the drive at its new place. Whatever goes wrong in between, the user is told where
 * the drive may be found. It says what is to be done next and takes what came of it; whoever has
 * the connection and the user does it. Pure.
 */
#ifndef DRIVEBRIDGE_SETUP_MOVE_H
#define DRIVEBRIDGE_SETUP_MOVE_H

#include "client/error.h"
#include "drivebridge/time.h"

#include <jansson.h>
#include <stdbool.h>

enum db_setup_action_kind {
	DB_SETUP_LOOK,  /* which drives answer at `address` */
	DB_SETUP_SET,   /* SetUp of `address` */
	DB_SETUP_SAY,   /* `text`, and `configuration` if it is not "" */
	DB_SETUP_ASK,   /* `text`, then whether to go on */
	DB_SETUP_PAUSE, /* some time, DB_SETUP_PAUSE_MS */
	DB_SETUP_FAIL,  /* with `error` and `text`: it ends after this, or after one more */
	DB_SETUP_END,
};

#define DB_SETUP_PAUSE_MS 500
#define DB_SETUP_TEXT_MAX 2048

struct db_setup_action {
	enum db_setup_action_kind kind;
	json_int_t address;
	json_int_t speed; /* at which it is looked or set, the bus out of service; 0: in service */
	const char *what; /* of SetUp: address, speed or save */
	bool has_value;   /* of SetUp: `to` of the move */
	const char *question; /* "go on?"; NULL: whether its power was off and on */
	const char *error;    /* name */
	const char *text;
	const char *configuration;
};

struct db_setup_move {
	/* Set by the caller: */
	const json_t *bus; /* of the service's description */
	bool is_address;   /* it gets another address, else another speed */
	json_int_t from;   /* its address */
	json_int_t to;     /* an address, or a speed in bit/s */
	json_int_t speed;  /* at which it communicates now; 0: the bus's own, in service */
	bool on_page;      /* texts name what a page has, else the commands of drivebridgectl */
	/* What was found: */
	char identity[256]; /* "" if the family has none */
	char drive[128];    /* its name in the configuration, "" when it has none */
	bool done;
	/* Private: */
	int step;
	json_int_t at;   /* the address at which it answers now; 0: not known */
	bool told;       /* the drive may have received the new value */
	bool doubted;    /* a message said where it may be */
	const char *why; /* after an error: why it is not known where the drive is; NULL */
	db_time until;   /* waits for its power until then; 0: not yet */
	struct db_client_error error;
	char text[DB_SETUP_TEXT_MAX];
	char configuration[256];
};

/* NULL: it can begin; else what is wrong. */
const char *db_setup_move_check(const struct db_setup_move *move);

/* What to do next. Its texts are valid until the next call. */
struct db_setup_action db_setup_move_next(struct db_setup_move *move, db_time now);

/* What came of it: the finds of a look, NULL otherwise; the answer to a question. */
void db_setup_move_take(struct db_setup_move *move, const json_t *finds, bool yes, db_time now);

/* It could not be done, or the user has ended it: that error is what comes next. False: it goes on
 * all the same. */
bool db_setup_move_fail(struct db_setup_move *move, const struct db_client_error *error);

#endif
