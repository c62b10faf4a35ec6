/* SPDX-License-Identifier: Apache-2.0 */
#include "setup/move.h"
#include "setup/sections.h"
#include "words/value.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Time allowed to switch a drive's power off and on. */
#define POWER_TIME (180 * DB_NS_PER_S)

#define FOUND_ERROR(name) "io.drivebridge.Client." name

enum step {
	BEGIN,
	TRY, /* what the family cannot: the service says why */
	SAY_LOOK,
	LOOK_FROM,
	LOOK_TO,
	ASK,
	SET,
	SAY_SET,
	FIND_FROM, /* where it answers now: still at its old address, or already at the new one */
	FIND_TO,
	ASK_SAVE,
	SAVE,
	SAY_SAVED,
	VERIFY,
	SAY_POWER,
	ASK_POWER,
	WAIT_FOR_POWER,
	PAUSE,
	LOOK_THERE,
	LOOK_FORMER,
	CONCLUDE,
	FAIL,
	DOUBT, /* after the error: where it may be */
	END,
};

static const char *bus_of(const struct db_setup_move *move)
{
	return db_words_text(move->bus, "name");
}

/* When the drive adopts the new value: at_once, power_up, never. */
static bool has_effect(const struct db_setup_move *move, const char *when)
{
	return strcmp(db_words_text(move->bus,
	                            move->is_address ? "address_effect" : "speed_effect"),
	              when) == 0;
}

/* A look for it at another speed than the bus's. */
static bool is_set_aside(const struct db_setup_move *move)
{
	return !move->is_address || move->speed != 0;
}

__attribute__((format(printf, 2, 3))) static void add(struct db_setup_move *move,
                                                      const char *format, ...)
{
	size_t used = strlen(move->text);
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(move->text + used, sizeof(move->text) - used, format, arguments);
	va_end(arguments);
}

/* A line of several: those after the first are indented. */
__attribute__((format(printf, 2, 3))) static void add_line(struct db_setup_move *move,
                                                           const char *format, ...)
{
	char line[sizeof(move->text)];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(line, sizeof(line), format, arguments);
	va_end(arguments);
	add(move, "%s%s\n", move->text[0] ? "  " : "", line);
}

const char *db_setup_move_check(const struct db_setup_move *move)
{
	return move->is_address && move->from == move->to ? "both addresses are the same" : NULL;
}

/* --- errors ----------------------------------------------------------------------------------- */

static void fail(struct db_setup_move *move, const char *name, const char *text)
{
	db_client_error_set(&move->error, name, "%s", text);
	move->step = FAIL;
}

/* Where the drive may be, when that is not known. */
static void doubt(struct db_setup_move *move, const char *why)
{
	long long from = (long long)move->from;
	long long to = (long long)move->to;
	const char *bus = bus_of(move);

	move->doubted = true;
	move->text[0] = '\0';
	if (move->is_address && move->on_page)
		add(move,
		    "%s: the drive may be found at address %lld or %lld of %s; a scan of %s shows "
		    "where",
		    why, from, to, bus, bus);
	else if (move->is_address)
		add(move,
		    "%s: the drive may be found at address %lld or %lld of %s; drivebridgectl scan "
		    "%s shows where",
		    why, from, to, bus, bus);
	else if (move->on_page)
		add(move,
		    "%s: the drive at address %lld may be found at its former speed or at %lld "
		    "bit/s; a scan of %s at all speeds shows where",
		    why, from, to, bus);
	else
		add(move,
		    "%s: the drive at address %lld may be found at its former speed or at %lld "
		    "bit/s; drivebridgectl scan %s --all-bauds shows where",
		    why, from, to, bus);
	fail(move, FOUND_ERROR("Doubtful"), move->text);
}

bool db_setup_move_fail(struct db_setup_move *move, const struct db_client_error *error)
{
	const char *why = db_words_text(error->parameters, "why");
	/* The result is not known: the port, the bus or the connection was lost meanwhile. */
	bool doubtful = strcmp(why, "port") == 0 || strcmp(why, "cancelled") == 0 ||
	                strcmp(error->name, DB_CLIENT_LOST) == 0 ||
	                strcmp(error->name, DB_CLIENT_TIMEOUT) == 0;

	/* A drive that adopts the value at once may not have answered. */
	if (move->step == SET && strcmp(why, "silent") == 0) {
		move->told = true;
		move->step = SAY_SET;
		return false;
	}
	move->told = move->told || (move->step == SET && doubtful);
	move->why = move->step == SAVE ? "it was not saved" :
	            move->told         ? "it was told, and may have taken it" :
	                                 NULL;
	fail(move, error->name, error->text);
	return true;
}

/* --- what comes next -------------------------------------------------------------------------- */

static void announce(struct db_setup_move *move)
{
	long long from = (long long)move->from;
	long long to = (long long)move->to;
	long long now = (long long)(move->speed ? move->speed :
	                                          json_integer_value(
							  json_object_get(move->bus, "speed")));

	add_line(move,
	         move->is_address ? "the drive at address %lld of %s gets address %lld" :
	                            "the drive at address %lld of %s gets speed %lld",
	         from, bus_of(move), to);
	if (move->identity[0])
		add_line(move, "it says that it is %s", move->identity);
	add_line(move, has_effect(move, "power_up") ? "it must stand, and takes it when it is "
	                                              "saved and its power was off and on" :
	                                              "it must stand, and takes it at once");
	if (!move->is_address) {
		add_line(move,
		         "all drives of a bus must have the same bit rate, and the bus in the "
		         "configuration too");
		add_line(move, "as long as they differ, those at %lld bit/s are offline", to);
	}
	if (!move->is_address && move->on_page)
		add_line(
			move,
			"the way back: the bit rate %lld for address %lld, spoken to at %lld bit/s",
			now, from, to);
	else if (!move->is_address)
		add_line(move, "the way back: drivebridgectl baud %s %lld %lld --baud %lld",
		         bus_of(move), from, now, to);
	else if (move->on_page)
		add_line(move, "the way back: give address %lld of %s the address %lld", to,
		         bus_of(move), from);
	else
		add_line(move, "the way back: drivebridgectl address %s %lld %lld", bus_of(move),
		         to, from);
	if (move->drive[0] && move->is_address)
		add_line(move,
		         "it is configured as %s: afterwards its section must say address = %lld",
		         move->drive, to);
	if (is_set_aside(move)) {
		add_line(move, "to look for it at another bit rate, bus %s is taken out of service",
		         bus_of(move));
		add_line(move,
		         "its drives, which must stand, are left as on-exit says, and are offline "
		         "for every PLC meanwhile");
	}
}

static void conclude(struct db_setup_move *move)
{
	long long to = (long long)move->to;

	if (!move->is_address) {
		add(move, "done: it answers at %lld bit/s. When all drives of the bus do:", to);
		snprintf(move->configuration, sizeof(move->configuration),
		         "bus %.64s {\n    %s = %lld\n    ...\n", bus_of(move),
		         db_setup_speed_key(move->bus), to);
	} else if (move->drive[0]) {
		add(move,
		    move->on_page ?
		            "done: it answers at address %lld. In the configuration, then reload:" :
		            "done: it answers at address %lld. In the configuration, then "
		            "drivebridgectl reload:",
		    to);
		snprintf(move->configuration, sizeof(move->configuration),
		         "drive %s {\n    address = %lld\n    ...\n", move->drive, to);
	} else {
		add(move,
		    move->on_page ? "done: it answers at address %lld. A scan of %s prints a "
		                    "section for the configuration" :
		                    "done: it answers at address %lld. drivebridgectl scan %s "
		                    "prints a section for the configuration",
		    to, bus_of(move));
	}
	move->done = true;
}

static struct db_setup_action report(struct db_setup_move *move)
{
	snprintf(move->text, sizeof(move->text), "%s", move->error.text);
	return (struct db_setup_action){ .kind = DB_SETUP_FAIL,
		                         .error = move->error.name,
		                         .text = move->text };
}

/* Past what needs no action. */
static void find_step(struct db_setup_move *move)
{
	if (move->step == BEGIN) {
		move->at = move->from;
		move->step = has_effect(move, "never") ? TRY : SAY_LOOK;
	}
	/* Only a page shows what is done meanwhile. */
	if (!move->on_page)
		move->step = move->step == SAY_LOOK  ? LOOK_FROM :
		             move->step == SAY_SET   ? FIND_FROM :
		             move->step == SAY_SAVED ? VERIFY :
		                                       move->step;
	if (move->step == VERIFY)
		move->step = has_effect(move, "power_up") && move->at != move->to ? SAY_POWER :
		                                                                    LOOK_THERE;
}

static struct db_setup_action look_step(const struct db_setup_move *move)
{
	bool new_place = move->step == WAIT_FOR_POWER || move->step == LOOK_THERE;
	struct db_setup_action action = { .kind = DB_SETUP_LOOK,
		                          .address = move->from,
		                          .speed = move->speed };

	if (move->step == LOOK_TO || move->step == FIND_TO || (new_place && move->is_address))
		action.address = move->to;
	else if (new_place)
		action.speed = move->to;
	return action;
}

static struct db_setup_action say_step(struct db_setup_move *move, db_time now)
{
	enum step next = END;

	switch (move->step) {
	case SAY_LOOK:
		add(move,
		    move->is_address ? "looking who answers at address %lld, and that nobody does "
		                       "at the new one" :
		                       "looking who answers at address %lld",
		    (long long)move->from);
		next = LOOK_FROM;
		break;
	case SAY_SET:
		add(move,
		    move->is_address ? "it was told its new address" : "it was told its new speed");
		next = FIND_FROM;
		break;
	case SAY_SAVED:
		add(move, "it was saved");
		next = VERIFY;
		break;
	case SAY_POWER:
		move->until = now + POWER_TIME;
		add(move, is_set_aside(move) && !move->on_page ?
		                  "now switch its power off and on, and press Enter" :
		                  "now switch its power off and on");
		next = is_set_aside(move) ? ASK_POWER : WAIT_FOR_POWER;
		break;
	default:
		conclude(move);
	}
	move->step = (int)next;
	return (struct db_setup_action){ .kind = DB_SETUP_SAY,
		                         .text = move->text,
		                         .configuration = move->configuration };
}

static struct db_setup_action ask_step(struct db_setup_move *move)
{
	const char *question = NULL;

	if (move->step == ASK) {
		announce(move);
		question = "go on?";
	} else if (move->step == ASK_SAVE) {
		add_line(move,
		         "save_parameters stores all of its parameters in its memory; what is "
		         "not saved is lost at power-off");
		question = "save?";
	} else {
		add_line(move, "now switch its power off and on, and go on when that is done");
	}
	return (struct db_setup_action){ .kind = DB_SETUP_ASK,
		                         .text = move->text,
		                         .question = question };
}

struct db_setup_action db_setup_move_next(struct db_setup_move *move, db_time now)
{
	bool saves;

	find_step(move);
	move->text[0] = move->configuration[0] = '\0';
	saves = move->step == SAVE;
	switch (move->step) {
	case TRY:
	case SET:
	case SAVE:
		return (struct db_setup_action){ .kind = DB_SETUP_SET,
			                         .address = move->at,
			                         .speed = move->speed,
			                         .what = saves            ? "save" :
			                                 move->is_address ? "address" :
			                                                    "speed",
			                         .has_value = !saves };
	case LOOK_FROM:
	case LOOK_TO:
	case FIND_FROM:
	case FIND_TO:
	case WAIT_FOR_POWER:
	case LOOK_THERE:
	case LOOK_FORMER:
		return look_step(move);
	case ASK:
	case ASK_SAVE:
	case ASK_POWER:
		return ask_step(move);
	case PAUSE:
		return (struct db_setup_action){ .kind = DB_SETUP_PAUSE };
	case DOUBT:
		doubt(move, move->why);
		move->step = END;
		return report(move);
	case FAIL:
		move->step = move->why && !move->doubted ? DOUBT : END;
		return report(move);
	case END:
		return (struct db_setup_action){ .kind = DB_SETUP_END };
	default:
		return say_step(move, now);
	}
}

/* --- what came of it -------------------------------------------------------------------------- */

static void take_first(struct db_setup_move *move, const json_t *find)
{
	const json_t *drives = json_object_get(find, "drives");

	if (!find || strcmp(db_words_text(find, "verdict"), "one") != 0) {
		add(move,
		    find ? "more than one drive answers at address %lld of %s: both would take "
		           "what is said. Take one of them off the line first" :
		    move->on_page ?
		           "no drive answers at address %lld of %s; a scan finds those that do" :
		           "no drive answers at address %lld of %s; drivebridgectl scan finds "
		           "those that do",
		    (long long)move->from, bus_of(move));
		fail(move, FOUND_ERROR("NotOne"), move->text);
		return;
	}
	snprintf(move->identity, sizeof(move->identity), "%s", db_words_text(find, "identity"));
	db_words_clean(move->identity);
	if (json_array_size(drives) > 0)
		snprintf(move->drive, sizeof(move->drive), "%s",
		         json_string_value(json_array_get(drives, 0)));
	move->step = move->is_address ? LOOK_TO : ASK;
}

/* Whether it answers at one of its places. */
static void take_place(struct db_setup_move *move, json_int_t place, bool answers)
{
	move->at = answers ? place : 0;
	if (move->step == FIND_FROM && !answers && move->is_address)
		move->step = FIND_TO;
	else if (!has_effect(move, "power_up"))
		move->step = VERIFY;
	/* If it went to its new speed at once, it is saved after it is found there. */
	else if (!answers)
		doubt(move, "it was told and does not answer to be saved");
	else
		move->step = ASK_SAVE;
}

static void take_look(struct db_setup_move *move, const json_t *find, db_time now)
{
	bool one = strcmp(db_words_text(find, "verdict"), "one") == 0;

	switch (move->step) {
	case LOOK_FROM:
		take_first(move, find);
		break;
	case LOOK_TO:
		move->step = ASK;
		add(move,
		    "address %lld of %s is taken: somebody answers there; choose another one. "
		    "Nothing was changed",
		    (long long)move->to, bus_of(move));
		if (find)
			fail(move, FOUND_ERROR("Taken"), move->text);
		break;
	case FIND_FROM:
		take_place(move, move->from, one);
		break;
	case FIND_TO:
		take_place(move, move->to, one);
		break;
	case LOOK_FORMER:
		/* If a drive answers at both addresses, there are two drives. */
		move->step = CONCLUDE;
		if (find)
			doubt(move, "somebody still answers at its former address");
		break;
	default:
		/* In service its new address is asked again and again; a bus that is out of service
		 * for that is scanned once. */
		if (one)
			move->step = move->is_address ? LOOK_FORMER : CONCLUDE;
		else if (move->step == LOOK_THERE || is_set_aside(move) || now > move->until)
			doubt(move, "it does not answer where it should");
		else
			move->step = PAUSE;
	}
}

void db_setup_move_take(struct db_setup_move *move, const json_t *finds, bool yes, db_time now)
{
	move->text[0] = '\0';
	switch (move->step) {
	case TRY:
		move->step = SAY_LOOK;
		break;
	case SET:
		move->told = true;
		move->step = SAY_SET;
		break;
	case SAVE:
		move->step = SAY_SAVED;
		break;
	case PAUSE:
		move->step = WAIT_FOR_POWER;
		break;
	case ASK:
	case ASK_SAVE:
	case ASK_POWER:
		if (yes)
			move->step = move->step == ASK      ? SET :
			             move->step == ASK_SAVE ? SAVE :
			                                      WAIT_FOR_POWER;
		else if (move->step == ASK_SAVE)
			doubt(move, "it was not saved");
		else if (move->step == ASK_POWER)
			doubt(move, "standard input is not a terminal, so nobody can confirm");
		else if (move->on_page)
			fail(move, FOUND_ERROR("Interrupted"), "nothing was changed");
		else
			move->step = END;
		break;
	default:
		take_look(move, json_array_get(finds, 0), now);
	}
}
