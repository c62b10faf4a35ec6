/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Giving a drive another address, or the speed of another bus: looked at before, asked, told, saved, and looked for
 * where it should be then. Whatever goes wrong in between, what is said tells where the drive may be found.
 */
#include "ctl/address.h"
#include "ctl/ask.h"
#include "ctl/search.h"
#include "ctl/value.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* How long a drive's power may take to be switched off and on. */
#define POWER_TIME_S 180

#define USAGE "io.drivebridge.Client.Usage"

/* Where the drive is, and where it is to be. */
struct move {
	struct db_ctl *ctl;
	const json_t *bus;
	bool address;     /* it gets another address, else another speed */
	json_int_t speed; /* at which it is spoken to; 0: the bus's own */
	json_int_t from;
	json_int_t to;              /* an address, or a speed */
	json_int_t at;              /* the address at which it answers now */
	char who[DB_CTL_VALUE_MAX]; /* its identity, "" where the family tells none */
	char drive[128];            /* as it is configured, "" when it is not */
	bool told;                  /* the drive may have taken it */
	bool doubted;               /* where it may be was said */
};

static const char *name_of(const struct move *move)
{
	return db_ctl_text(move->bus, "name");
}

/* Until when the drive goes by what it was told: at_once, power_up, never. */
static const char *effect_of(const struct move *move)
{
	return db_ctl_text(move->bus, move->address ? "address_effect" : "speed_effect");
}

/* --- looking ----------------------------------------------------------------------------------------------- */

/* Who answers at an address; `speed` 0: that of the bus, in service. */
static enum db_ctl_status look_at(const struct move *move, json_int_t address, json_int_t speed,
                                  struct db_ctl_search *search)
{
	json_t *parameters = json_pack("{s:s, s:I, s:I}", "bus", name_of(move), "first", address,
	                               "last", address);
	enum db_ctl_status status;

	if (speed != 0)
		(void)json_object_set_new(parameters, "speeds", json_pack("[I]", speed));
	status = db_ctl_search(move->ctl, parameters, search);
	if (status == DB_CTL_OK && search->interrupted)
		status = db_ctl_complain(move->ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
		                         "interrupted; nothing more was done");
	return status;
}

/* "one", "two", "garbled"; "" when nobody answers. */
static const char *verdict_of(const struct db_ctl_search *search)
{
	return db_ctl_text(json_array_get(search->finds, 0), "verdict");
}

/* Exactly one drive is there; who it is is kept. */
static enum db_ctl_status find_drive(struct move *move)
{
	struct db_ctl_search search;
	enum db_ctl_status status = look_at(move, move->from, move->speed, &search);
	const json_t *find = json_array_get(search.finds, 0);

	if (status == DB_CTL_OK && strcmp(verdict_of(&search), "one") != 0)
		status = db_ctl_complain(
			move->ctl, DB_CTL_NO, "io.drivebridge.Client.NotOne",
			verdict_of(&search)[0] ?
				"more than one drive answers at address %lld of %s: both would "
				"take what is said. Take one of them off the line first" :
				"no drive answers at address %lld of %s; drivebridgectl scan finds "
				"those that do",
			(long long)move->from, name_of(move));
	(void)snprintf(move->who, sizeof(move->who), "%s", db_ctl_text(find, "identity"));
	db_ctl_clean(move->who);
	if (json_array_size(json_object_get(find, "drives")) > 0)
		(void)snprintf(
			move->drive, sizeof(move->drive), "%s",
			json_string_value(json_array_get(json_object_get(find, "drives"), 0)));
	db_ctl_search_clear(&search);
	return status;
}

/* Nobody has the new address. */
static enum db_ctl_status check_free(const struct move *move)
{
	struct db_ctl_search search;
	enum db_ctl_status status = look_at(move, move->to, move->speed, &search);

	if (status == DB_CTL_OK && verdict_of(&search)[0])
		status = db_ctl_complain(move->ctl, DB_CTL_NO, "io.drivebridge.Client.Taken",
		                         "address %lld of %s is taken: somebody answers there; "
		                         "choose another one. Nothing was changed",
		                         (long long)move->to, name_of(move));
	db_ctl_search_clear(&search);
	return status;
}

/* --- what is said of it ------------------------------------------------------------------------------------ */

static void announce(const struct move *move)
{
	bool power_up = strcmp(effect_of(move), "power_up") == 0;

	if (move->ctl->json)
		return;
	(void)printf("the drive at address %lld of %s%s%s%s gets %s %lld\n", (long long)move->from,
	             name_of(move), move->who[0] ? " (" : "", move->who, move->who[0] ? ")" : "",
	             move->address ? "address" : "speed", (long long)move->to);
	(void)printf("  it must stand, and takes it %s\n",
	             power_up ? "when it is saved and its power was off and on" : "at once");
	if (move->address)
		(void)printf("  the way back: drivebridgectl address %s %lld %lld\n", name_of(move),
		             (long long)move->to, (long long)move->from);
	else
		(void)printf(
			"  all drives of a bus must have the same speed, and the bus in the "
			"configuration too: as long as\n  they differ, those at %lld bit/s are "
			"offline. The way back: drivebridgectl baud %s %lld %lld --speed %lld\n",
			(long long)move->to, name_of(move), (long long)move->from,
			(long long)(move->speed ? move->speed :
		                                  json_integer_value(
							  json_object_get(move->bus, "speed"))),
			(long long)move->to);
	if (move->drive[0] && move->address)
		(void)printf("  it is configured as %s: afterwards its section must say address = "
		             "%lld\n",
		             move->drive, (long long)move->to);
}

/* Where it may be, when it is not known. */
static enum db_ctl_status tell_doubt(struct move *move, const char *why)
{
	move->doubted = true;
	if (move->address)
		return db_ctl_complain(move->ctl, DB_CTL_NO, "io.drivebridge.Client.Doubtful",
		                       "%s: the drive may be found at address %lld or %lld of %s; "
		                       "drivebridgectl scan %s shows where",
		                       why, (long long)move->from, (long long)move->to,
		                       name_of(move), name_of(move));
	return db_ctl_complain(move->ctl, DB_CTL_NO, "io.drivebridge.Client.Doubtful",
	                       "%s: the drive at address %lld may be found at its former speed or "
	                       "at %lld bit/s; drivebridgectl scan %s --all-speeds shows where",
	                       why, (long long)move->from, (long long)move->to, name_of(move));
}

static void conclude(const struct move *move)
{
	const char *key = strstr(db_ctl_text(move->bus, "protocol"), "can") ? "bitrate" : "baud";
	json_t *object;

	if (move->ctl->json) {
		object = json_pack("{s:s, s:I, s:I, s:s, s:s}", "bus", name_of(move), "from",
		                   move->from, "to", move->to, "identity", move->who, "drive",
		                   move->drive);
		db_ctl_print_json(object);
		json_decref(object);
		return;
	}
	if (!move->address)
		(void)printf("done: it answers at %lld bit/s. When all drives of the bus do:\n\n"
		             "bus %s {\n    %s = %lld\n    ...\n",
		             (long long)move->to, name_of(move), key, (long long)move->to);
	else if (move->drive[0])
		(void)printf("done: it answers at address %lld. In the configuration, then "
		             "drivebridgectl reload:\n\ndrive %s {\n    address = %lld\n    ...\n",
		             (long long)move->to, move->drive, (long long)move->to);
	else
		(void)printf("done: it answers at address %lld. drivebridgectl scan %s prints a "
		             "section for the configuration\n",
		             (long long)move->to, name_of(move));
}

/* --- telling the drive ------------------------------------------------------------------------------------- */

static enum db_ctl_status set_up(const struct move *move, const char *what,
                                 struct db_client_error *error)
{
	json_t *parameters = json_pack("{s:s, s:I, s:s, s:I}", "bus", name_of(move), "address",
	                               move->at, "what", what, "value", move->to);
	json_t *answer = NULL;
	int failed;

	if (move->speed != 0)
		(void)json_object_set_new(parameters, "speeds", json_pack("[I]", move->speed));
	failed = db_client_call(move->ctl->client, "SetUp", parameters, DB_CTL_DRIVE_TIMEOUT_MS,
	                        &answer, error);
	json_decref(answer);
	return failed == 0 ? DB_CTL_OK : DB_CTL_NO;
}

/* How it ended is not known: the port, the bus or the connection was lost meanwhile. */
static bool is_doubtful(const struct db_client_error *error)
{
	const char *why = db_ctl_text(error->parameters, "why");

	return strcmp(why, "port") == 0 || strcmp(why, "cancelled") == 0 ||
	       strcmp(error->name, DB_CLIENT_LOST) == 0 ||
	       strcmp(error->name, DB_CLIENT_TIMEOUT) == 0;
}

static enum db_ctl_status tell_drive(struct move *move)
{
	struct db_client_error error = { .parameters = NULL };
	enum db_ctl_status status = set_up(move, move->address ? "address" : "speed", &error);

	/* Who goes by it at once may not have answered any more. */
	if (status != DB_CTL_OK && strcmp(db_ctl_text(error.parameters, "why"), "silent") == 0)
		status = DB_CTL_OK;
	move->told = status == DB_CTL_OK || is_doubtful(&error);
	if (status != DB_CTL_OK)
		status = db_ctl_fail(move->ctl, &error);
	db_client_error_clear(&error);
	return status;
}

/* Where it answers now: still at its old address, or at the new one already. */
static enum db_ctl_status find_again(struct move *move)
{
	const json_int_t places[] = { move->from, move->to };
	enum db_ctl_status status = DB_CTL_OK;

	move->at = 0;
	for (size_t i = 0; status == DB_CTL_OK && move->at == 0 && i < (move->address ? 2 : 1);
	     i++) {
		struct db_ctl_search search;

		status = look_at(move, places[i], move->speed, &search);
		if (status == DB_CTL_OK && strcmp(verdict_of(&search), "one") == 0)
			move->at = places[i];
		db_ctl_search_clear(&search);
	}
	return status;
}

static enum db_ctl_status save(struct move *move)
{
	struct db_client_error error = { .parameters = NULL };
	enum db_ctl_status status;

	/* One that went to its new speed at once is saved by who finds it there. */
	if (move->at == 0)
		return tell_doubt(move, "it was told and does not answer to be saved");
	if (!move->ctl->json)
		(void)puts(
			"save_parameters writes all that it holds into its memory; without it, the "
			"change is lost with its power");
	status = db_ctl_ask(move->ctl, "save?");
	if (status == DB_CTL_OK && set_up(move, "save", &error) != DB_CTL_OK)
		status = db_ctl_fail(move->ctl, &error);
	db_client_error_clear(&error);
	return status == DB_CTL_OK ? status : tell_doubt(move, "it was not saved");
}

/* --- where it should be then ------------------------------------------------------------------------------- */

static bool is_there(const struct move *move, enum db_ctl_status *status)
{
	struct db_ctl_search search;
	bool there;

	*status = look_at(move, move->address ? move->to : move->from,
	                  move->address ? move->speed : move->to, &search);
	there = *status == DB_CTL_OK && strcmp(verdict_of(&search), "one") == 0;
	db_ctl_search_clear(&search);
	return there;
}

/* Somebody switches its power. In service its new address is looked at again and again; a bus that has to be set
 * aside for that is, once, when somebody says that it was done. */
static enum db_ctl_status wait_for_power(struct move *move)
{
	bool aside = !move->address || move->speed != 0;
	const struct timespec pause = { .tv_nsec = 500000000 };
	enum db_ctl_status status = DB_CTL_OK;
	time_t until = time(NULL) + POWER_TIME_S;
	char line[16];

	if (!move->ctl->json)
		(void)printf("now switch its power off and on%s\n",
		             aside ? ", and press Enter" : "");
	(void)fflush(stdout);
	if (aside && (move->ctl->json || !fgets(line, sizeof(line), stdin)))
		return tell_doubt(move, "nobody can be waited for here");
	while (!is_there(move, &status)) {
		if (status != DB_CTL_OK)
			return status;
		if (aside || time(NULL) > until)
			return tell_doubt(move, "it does not answer where it should");
		(void)nanosleep(&pause, NULL);
	}
	return status;
}

static enum db_ctl_status verify(struct move *move)
{
	struct db_ctl_search search;
	enum db_ctl_status status = DB_CTL_OK;

	if (strcmp(effect_of(move), "power_up") == 0 && move->at != move->to)
		status = wait_for_power(move);
	else if (!is_there(move, &status) && status == DB_CTL_OK)
		status = tell_doubt(move, "it does not answer where it should");
	if (status != DB_CTL_OK || !move->address)
		return status;
	/* A drive that answers at both would be two. */
	status = look_at(move, move->from, move->speed, &search);
	if (status == DB_CTL_OK && verdict_of(&search)[0])
		status = tell_doubt(move, "somebody still answers at its former address");
	db_ctl_search_clear(&search);
	return status;
}

static enum db_ctl_status carry_out(struct move *move)
{
	bool saves = strcmp(effect_of(move), "power_up") == 0;
	enum db_ctl_status status = find_drive(move);

	if (status == DB_CTL_OK && move->address)
		status = check_free(move);
	if (status == DB_CTL_OK) {
		announce(move);
		status = db_ctl_ask(move->ctl, "go on?");
	}
	if (status == DB_CTL_OK)
		status = tell_drive(move);
	if (status == DB_CTL_OK)
		status = find_again(move);
	if (status == DB_CTL_OK && saves)
		status = save(move);
	if (status == DB_CTL_OK)
		status = verify(move);
	if (status == DB_CTL_OK)
		conclude(move);
	else if (move->told && !move->doubted)
		(void)tell_doubt(move, "it was told, and may have taken it");
	return status;
}

/* --- the commands ------------------------------------------------------------------------------------------ */

static bool read_number(const struct db_ctl *ctl, const char *text, json_int_t *number)
{
	char *end;

	errno = 0;
	*number = strtoll(text, &end, 10);
	if (text[0] != '\0' && *end == '\0' && errno == 0 && *number >= 0 && *number <= 4000000)
		return true;
	(void)db_ctl_complain(ctl, DB_CTL_USAGE, USAGE, "\"%s\" is not a number that can be here",
	                      text);
	return false;
}

static enum db_ctl_status begin(struct db_ctl *ctl, struct move *move, char **arguments)
{
	struct db_client_error error = { .parameters = NULL };
	enum db_ctl_status status;

	move->ctl = ctl;
	move->bus = db_ctl_find_bus(ctl, arguments[0]);
	if (!move->bus || !read_number(ctl, arguments[1], &move->from) ||
	    !read_number(ctl, arguments[2], &move->to) ||
	    (ctl->speed && !read_number(ctl, ctl->speed, &move->speed)))
		return DB_CTL_USAGE;
	move->at = move->from;
	if (move->address && move->from == move->to)
		return db_ctl_complain(ctl, DB_CTL_USAGE, USAGE, "both addresses are the same");
	/* The service says why. */
	if (strcmp(effect_of(move), "never") == 0 &&
	    set_up(move, move->address ? "address" : "speed", &error) != DB_CTL_OK) {
		status = db_ctl_fail(ctl, &error);
		db_client_error_clear(&error);
		return status;
	}
	return carry_out(move);
}

enum db_ctl_status db_ctl_address(struct db_ctl *ctl, int count, char **arguments)
{
	struct move move = { .address = true };

	(void)count;
	return begin(ctl, &move, arguments);
}

enum db_ctl_status db_ctl_baud(struct db_ctl *ctl, int count, char **arguments)
{
	struct move move = { .address = false };

	(void)count;
	return begin(ctl, &move, arguments);
}
