/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/call.h"
#include "control/values.h"
#include "drivebridge/clock.h"
#include "drivebridge/command_table.h"
#include "drivebridge/positions.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define ERROR(name) "io.drivebridge.Control." name
#define AUDIT_TEXT_MAX 160

/* --- the drive now ---------------------------------------------------------------------------- */

/* False: the call was answered. *unit: of the drive's positions. */
static bool see_drive(const struct db_call *call, const struct db_named_drive *drive,
                      struct db_position_drive *now, const char **unit)
{
	const struct db_control_socket *control = call->session->control;
	struct db_named_place place;

	if (!db_named_place(control->setup.registers, drive->number, &place)) {
		db_session_fail_drive(call->session, drive->config->name);
		return false;
	}
	*now = (struct db_position_drive){
		.online = place.online,
		.stands = place.stands,
		.lost = place.lost,
		.homed = place.homed_here,
		.position = place.position,
		.counts_per_unit = place.counts_per_unit,
		.identified = place.identified,
	};
	memcpy(now->identity, place.identity, sizeof(now->identity));
	/* The numbers of drives are unique in a run. HOMED is among it for drives that home by
	 * themselves. */
	snprintf(now->origin, sizeof(now->origin),
	         "%08" PRIx32 "-%u-%" PRIu32 "-%" PRIu32 "-%" PRIu32 "-%d", control->run,
	         (unsigned)drive->number, place.commands, place.restarts, place.doubts,
	         place.homed);
	*unit = place.unit;
	return true;
}

static struct db_positions *positions_of(const struct db_call *call)
{
	const struct db_control_socket_setup *setup = &call->session->control->setup;
	struct db_positions *positions = setup->ops->positions(setup->context);

	if (!positions)
		db_session_fail_result(call->session, DB_RESULT_BUSY, "");
	return positions;
}

static void refuse(const struct db_call *call, const char *why, const char *text)
{
	db_session_fail(call->session, ERROR("PositionRefused"),
	                json_pack("{s:s, s:s}", "why", why, "text", text));
}

static void refuse_flaw(const struct db_call *call, enum db_position_flaw flaw)
{
	refuse(call, db_position_flaws[flaw].name, db_position_flaws[flaw].text);
}

/* The position that the call names. Null: the call was answered. */
static const struct db_position *find_position(const struct db_call *call, const char *drive,
                                               const char *name)
{
	const struct db_positions *positions = positions_of(call);
	const struct db_position *found;

	if (!positions)
		return NULL;
	found = db_positions_find(positions, drive, name);
	if (!found)
		db_session_fail(call->session, ERROR("NoSuchPosition"),
		                json_pack("{s:s, s:s}", "drive", drive, "name", name));
	return found;
}

static json_t *describe(const struct db_position *position, const struct db_position_drive *now,
                        const char *unit)
{
	enum db_position_flaw flaw = db_position_judge(position, now);

	return json_pack("{s:s, s:I, s:f, s:s, s:s, s:s, s:I, s:o}", "name", position->name,
	                 "counts", (json_int_t)position->counts, "units",
	                 (double)position->counts / position->counts_per_unit, "unit", unit, "flaw",
	                 db_position_flaws[flaw].name, "advice", db_position_flaws[flaw].text,
	                 "taught_us", (json_int_t)position->taught_us, "taught_by",
	                 db_values_text(position->by));
}

/* --- the calls -------------------------------------------------------------------------------- */

void db_positions_call(const struct db_call *call)
{
	const struct db_control_socket_setup *setup = &call->session->control->setup;
	const struct db_positions *positions;
	struct db_named_drive drive;
	struct db_position_drive now;
	const char *unit;
	const char *name;
	json_t *list;

	if (!db_call_drive(call, false, &drive, &name))
		return;
	positions = positions_of(call);
	if (!positions || !see_drive(call, &drive, &now, &unit))
		return;
	list = json_array();
	for (size_t i = 0; i < positions->count; i++) {
		const struct db_position *position = &positions->list[i];

		if (strcmp(position->drive, name) == 0)
			json_array_append_new(list, describe(position, &now, unit));
	}
	db_session_reply(call->session,
	                 json_pack("{s:o, s:s}", "positions", list, "trouble",
	                           setup->ops->positions_trouble(setup->context)),
	                 false);
}

static void record(const struct db_call *call, const char *what, const struct db_position *position,
                   const char *unit)
{
	char text[AUDIT_TEXT_MAX];

	snprintf(text, sizeof(text), "%s at %.10g%s%s (%" PRId32 ")", position->name,
	         (double)position->counts / position->counts_per_unit, unit[0] ? " " : "", unit,
	         position->counts);
	db_session_record(call->session, &(struct db_audit_entry){ .kind = DB_AUDIT_POSITION,
	                                                           .what = what,
	                                                           .drive = position->drive,
	                                                           .text = text,
	                                                           .result = DB_RESULT_OK });
}

/* True if the drive's present place can be taught; if not, the call is answered. */
static bool may_teach(const struct db_call *call, const struct db_position_drive *now)
{
	if (!now->online || !now->identified || !(now->counts_per_unit > 0.0))
		refuse_flaw(call, DB_POSITION_OFFLINE);
	else if (now->lost)
		refuse_flaw(call, DB_POSITION_ORIGIN_LOST);
	else if (!now->stands)
		refuse(call, "moves", "the drive moves: teach it when it stands");
	else
		return true;
	return false;
}

/* Puts it into the list and answers the call. */
static void put(const struct db_call *call, const struct db_position *position, const char *what,
                const struct db_position_drive *now, const char *unit)
{
	const struct db_control_socket_setup *setup = &call->session->control->setup;
	struct db_positions *positions = positions_of(call);
	int error = positions ? db_positions_put(positions, position) : 0;

	if (!positions)
		return;
	if (error == -ENOSPC) {
		refuse(call, "full",
		       "there are as many named positions as there may be: forget one");
		return;
	}
	if (error != 0) {
		db_session_fail_result(call->session, DB_RESULT_BUSY, "");
		return;
	}
	record(call, what, position, unit);
	setup->ops->positions_changed(setup->context);
	db_session_reply(call->session,
	                 json_pack("{s:o}", "position", describe(position, now, unit)), false);
}

void db_positions_teach(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_position position = { .taught_us = 0 };
	const struct db_position *former;
	enum db_position_flaw flaw;
	struct db_named_drive drive;
	struct db_position_drive now;
	const char *drive_name;
	const char *name;
	const char *unit;
	bool keeps = false;

	if (!db_session_require_act(session) || !db_call_drive(call, false, &drive, &drive_name) ||
	    !db_call_text(call, "name", &name) || !db_call_optional_flag(call, "keep", &keeps))
		return;
	if (!db_actors_name_is_good(name) || strlen(drive_name) >= sizeof(position.drive)) {
		db_session_fail_value(session, "name",
		                      "a name has 1 to 32 bytes of UTF-8 that can be seen, and no "
		                      "space first or last");
		return;
	}
	if (!see_drive(call, &drive, &now, &unit) || !may_teach(call, &now))
		return;
	if (keeps) {
		/* A person confirms that the drive counts from where it did when the position was
		 * taught. */
		former = find_position(call, drive_name, name);
		if (!former)
			return;
		flaw = db_position_judge(former, &now);
		if (flaw != DB_POSITION_GOOD && flaw != DB_POSITION_OTHER_ORIGIN) {
			refuse_flaw(call, flaw);
			return;
		}
		position = *former;
	} else {
		position.counts = now.position;
		position.counts_per_unit = now.counts_per_unit;
		snprintf(position.drive, sizeof(position.drive), "%s", drive_name);
		snprintf(position.name, sizeof(position.name), "%s", name);
		memcpy(position.identity, now.identity, sizeof(position.identity));
	}
	position.homed = now.homed;
	memcpy(position.origin, now.origin, sizeof(position.origin));
	position.taught_us = db_clock_wall_us();
	db_session_text(session, position.by);
	put(call, &position, keeps ? "kept" : "taught", &now, unit);
}

void db_positions_forget(const struct db_call *call)
{
	const struct db_control_socket_setup *setup = &call->session->control->setup;
	const struct db_position *position;
	struct db_named_drive drive;
	const char *drive_name;
	const char *name;

	if (!db_session_require_act(call->session) ||
	    !db_call_drive(call, false, &drive, &drive_name) || !db_call_text(call, "name", &name))
		return;
	position = find_position(call, drive_name, name);
	if (!position)
		return;
	record(call, "forgotten", position, "");
	/* They are found, so they are there. */
	(void)db_positions_remove(setup->ops->positions(setup->context), drive_name, name);
	setup->ops->positions_changed(setup->context);
	db_session_reply(call->session, NULL, false);
}

/* --- going there ------------------------------------------------------------------------------ */

/* A stop is always a stop, whatever else is in the call. */
static bool names_position(const struct db_call *call, const struct db_command_row *row)
{
	const json_t *name = json_object_get(call->parameters, "position");

	return name && !json_is_null(name) && !db_command_is_stop(row->code);
}

bool db_positions_resolve(const struct db_call *call, const struct db_command_row *row,
                          const struct db_named_drive *drive)
{
	json_t *arguments = json_object_get(call->parameters, "arguments");
	const struct db_position *position;
	const char *name;

	if (!names_position(call, row))
		return true;
	if (!db_call_text(call, "position", &name))
		return false;
	if (row->code != DB_CMD_MOVE_ABSOLUTE) {
		db_session_fail_value(call->session, "position", "it belongs to move_absolute");
		return false;
	}
	if (json_object_get(arguments, "target_position")) {
		db_session_fail_value(call->session, "target_position",
		                      "the named position says it");
		return false;
	}
	position = find_position(call, drive->config->name, name);
	if (!position)
		return false;
	if (!json_is_object(arguments))
		json_object_set_new(call->parameters, "arguments", json_object());
	json_object_set_new(json_object_get(call->parameters, "arguments"), "target_position",
	                    json_integer(position->counts));
	return true;
}

bool db_positions_allow(const struct db_call *call, const struct db_command_row *row,
                        const struct db_named_drive *drive)
{
	const struct db_position *position;
	struct db_position_drive now;
	char text[AUDIT_TEXT_MAX];
	enum db_position_flaw flaw;
	const char *name;
	const char *unit;

	if (!names_position(call, row))
		return true;
	if (!db_call_text(call, "position", &name) || !see_drive(call, drive, &now, &unit))
		return false;
	position = find_position(call, drive->config->name, name);
	if (!position)
		return false;
	flaw = db_position_judge(position, &now);
	if (flaw == DB_POSITION_GOOD)
		return true;
	snprintf(text, sizeof(text), "%s: %s", name, db_position_flaws[flaw].name);
	db_session_record(call->session, &(struct db_audit_entry){ .kind = DB_AUDIT_POSITION,
	                                                           .what = "not gone to",
	                                                           .drive = drive->config->name,
	                                                           .text = text,
	                                                           .result = DB_RESULT_REFUSED });
	refuse_flaw(call, flaw);
	return false;
}
