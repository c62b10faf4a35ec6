/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "codec/can.h"
#include "control/act.h"
#include "control/values.h"
#include "drivebridge/process.h"
#include "drivebridge/scan.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

/* Interval of reports. */
#define INTERVAL (100 * DB_NS_PER_MS)
#define NAME_MAX_LENGTH 64
#define SPEED_MAX 4000000

/* A session's scan. */
struct wait {
	char bus[NAME_MAX_LENGTH];
	uint32_t number;
	uint32_t told; /* finds reported so far */
	uint32_t asked;
	bool sets_up;
	char whose[DB_SCAN_WHOSE_MAX];
};

/* --- reports ---------------------------------------------------------------------------------- */

static json_t *describe_find(struct db_registers *registers, const char *bus,
                             const struct db_scan_find *find)
{
	static const char *const verdicts[] = {
		[DB_SCAN_ONE] = "one",
		[DB_SCAN_TWO] = "two",
		[DB_SCAN_GARBLED] = "garbled",
	};
	json_t *drives = json_array();
	struct db_named_drive drive;

	for (size_t i = 0; i < db_named_drive_count(registers); i++) {
		if (db_named_drive_at(registers, i, &drive) && strcmp(drive.bus->name, bus) == 0 &&
		    drive.config->address == find->address &&
		    (drive.bus->driver->medium == DB_MEDIUM_CAN ? drive.bus->bitrate :
		                                                  drive.bus->baud) == find->speed)
			json_array_append_new(drives, json_string(drive.config->name));
	}
	return json_pack("{s:I, s:I, s:s, s:o, s:o, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:o}",
	                 "speed", (json_int_t)find->speed, "address", (json_int_t)find->address,
	                 "verdict", verdicts[find->verdict], "identity",
	                 db_values_text(find->identity), "other", db_values_text(find->other),
	                 "asked", (json_int_t)find->asked, "answered", (json_int_t)find->answered,
	                 "garbled", (json_int_t)find->garbled, "doubled", (json_int_t)find->doubled,
	                 "time_min_us", (json_int_t)find->time_min_us, "time_mean_us",
	                 (json_int_t)find->time_mean_us, "time_max_us",
	                 (json_int_t)find->time_max_us, "drives", drives);
}

/* Reports what is new since the last report. */
static void tell(struct db_session *session, const struct db_scan_progress *progress)
{
	struct db_control_socket *control = session->control;
	struct wait *wait = session->job;
	json_t *finds = json_array();
	json_t *foreign;

	for (; wait->told < progress->finds; wait->told++)
		json_array_append_new(
			finds, describe_find(control->setup.registers, wait->bus,
		                             control->setup.ops->scan_find(control->setup.context,
		                                                           wait->bus, wait->told)));
	wait->asked = progress->asked;
	foreign = json_array();
	for (size_t i = 0; i < progress->foreign && progress->end != DB_SCAN_RUNS; i++) {
		const struct db_scan_foreign *frame = control->setup.ops->scan_foreign(
			control->setup.context, wait->bus, i);

		json_array_append_new(foreign,
		                      json_pack("{s:I, s:b, s:I}", "id",
		                                (json_int_t)(frame->id & DB_CAN_ID_MASK),
		                                "extended", (frame->id & DB_CAN_EXTENDED) != 0,
		                                "count", (json_int_t)frame->count));
	}
	db_session_reply(session,
	                 json_pack("{s:I, s:I, s:I, s:I, s:o, s:o, s:I}", "asked",
	                           (json_int_t)progress->asked, "total",
	                           (json_int_t)progress->total, "speed",
	                           (json_int_t)progress->speed, "address",
	                           (json_int_t)progress->address, "finds", finds, "foreign",
	                           foreign, "wait_us", (json_int_t)progress->wait_us),
	                 progress->end == DB_SCAN_RUNS);
}

static void fail(struct db_session *session, const char *why, json_t *text)
{
	db_session_fail(session, "io.drivebridge.Control.ScanFailed",
	                json_pack("{s:s, s:o}", "why", why, "text", text));
}

/* The reason, where it did not end with DONE. */
static void tell_failure(struct db_session *session, const struct db_scan_progress *progress)
{
	const char *drive = db_named_name(session->control->setup.registers, progress->drive);
	uint32_t gap_us = progress->gap_us < progress->needed_us ? progress->gap_us : 0;

	switch (progress->end) {
	case DB_SCAN_NO_ROOM:
		fail(session, "no_room",
		     json_sprintf(
			     "a question takes up to %u ms, and the drives' cycle leaves %u ms: "
			     "drives would be read late. Raise cycle-ms of this bus by %u for the "
			     "time of the scan, or scan with the bus out of service, all its "
			     "drives standing",
			     (progress->needed_us + 999) / 1000, progress->gap_us / 1000,
			     (progress->needed_us - gap_us + 999) / 1000));
		break;
	case DB_SCAN_MOVES:
		fail(session, "moves",
		     json_sprintf(
			     "%s does not stand: a bus is taken out of service, and a drive on a "
			     "serial line set up and saved, only when all of its drives stand; "
			     "stop it first",
			     drive));
		break;
	case DB_SCAN_PORT:
		fail(session, "port",
		     json_sprintf("the bus is down: %s; drivebridgectl status says what to do",
		                  strerror(progress->error)));
		break;
	case DB_SCAN_REFUSED:
		fail(session, "refused", json_string("the drive refuses it, or has no such thing"));
		break;
	case DB_SCAN_SILENT:
		fail(session, "silent",
		     json_string("the drive did not answer when it was told: it may have taken it, "
		                 "or not"));
		break;
	case DB_SCAN_NOT_ONE:
		fail(session, "not_one",
		     json_string("not one drive, and one only, answers at this address; nothing "
		                 "was changed"));
		break;
	case DB_SCAN_STANDS_NOT:
		fail(session, "moves",
		     json_string(
			     "the drive does not stand, or does not say so; nothing was changed"));
		break;
	case DB_SCAN_CANCELLED:
	default:
		fail(session, "cancelled", json_string("the bus ended before the scan did"));
		break;
	}
}

void db_scan_look(struct db_session *session, db_time now)
{
	const struct db_control_socket *control = session->control;
	const struct wait *wait = session->job;
	struct db_scan_progress progress;

	session->due = now + INTERVAL;
	if (!control->setup.ops->scan_read(control->setup.context, wait->bus, wait->number,
	                                   &progress))
		progress = (struct db_scan_progress){ .end = DB_SCAN_CANCELLED };
	if (progress.end == DB_SCAN_DONE && wait->sets_up)
		db_session_reply(session, NULL, false);
	else if (progress.end == DB_SCAN_DONE)
		tell(session, &progress);
	else if (progress.end != DB_SCAN_RUNS)
		tell_failure(session, &progress);
	/* A slow reader gets more of it at once. */
	else if (session->more && !wait->sets_up && !session->out &&
	         (progress.asked != wait->asked || progress.finds != wait->told))
		tell(session, &progress);
}

void db_scan_forget(struct db_session *session)
{
	const struct db_control_socket *control = session->control;
	const struct wait *wait = session->job;

	control->setup.ops->scan_cancel(control->setup.context, wait->bus, wait->number);
}

/* --- the calls -------------------------------------------------------------------------------- */

/* Null when there is no such bus; the call was answered then. */
static const struct db_bus_config *find_bus(const struct db_call *call)
{
	struct db_registers *registers = call->session->control->setup.registers;
	const char *name;

	if (!db_call_text(call, "bus", &name))
		return NULL;
	for (size_t i = 0; db_named_bus(registers, i); i++) {
		const struct db_bus_config *bus = db_named_bus(registers, i);

		if (strcmp(bus->name, name) != 0)
			continue;
		if (bus->driver->inquire)
			return bus;
		fail(call->session, "refused",
		     json_sprintf("drives of protocol %s cannot be searched for",
		                  bus->driver->name));
		return NULL;
	}
	db_session_fail(call->session, "io.drivebridge.Control.NoSuchBus",
	                json_pack("{s:s}", "bus", name));
	return NULL;
}

/* A number that may be missing, and then the variable is unchanged. */
static bool take_number(const struct db_call *call, const char *name, int64_t max, unsigned *number)
{
	const json_t *value = json_object_get(call->parameters, name);
	int64_t given;

	if (!value || json_is_null(value))
		return true;
	if (!db_call_number(call, name, 0, max, &given))
		return false;
	*number = (unsigned)given;
	return true;
}

/* The given speeds, or all that drives of the family can have: then the bus is out of service. */
static bool take_speeds(const struct db_call *call, const struct db_bus_config *bus,
                        struct db_scan_plan *plan)
{
	const json_t *speeds = json_object_get(call->parameters, "speeds");
	const json_t *speed;
	bool all = false;
	size_t i;

	if (!db_call_optional_flag(call, "all_speeds", &all))
		return false;
	for (i = 0;
	     all && bus->driver->speeds && bus->driver->speeds[i] != 0 && i < DB_SCAN_SPEEDS_MAX;
	     i++)
		plan->speeds[plan->speed_count++] = bus->driver->speeds[i];
	if (speeds && !json_is_null(speeds)) {
		if (all || !json_is_array(speeds) || json_array_size(speeds) == 0 ||
		    json_array_size(speeds) > DB_SCAN_SPEEDS_MAX) {
			db_session_fail_parameter(call->session, "speeds");
			return false;
		}
		json_array_foreach(speeds, i, speed)
		{
			json_int_t given = json_integer_value(speed);

			if (given < 1 || given > SPEED_MAX) {
				db_session_fail_parameter(call->session, "speeds");
				return false;
			}
			plan->speeds[plan->speed_count++] = (unsigned)given;
		}
	}
	plan->aside = plan->speed_count > 0;
	if (!plan->aside || bus->driver->medium != DB_MEDIUM_CAN || !bus->transport->uses_interface)
		return true;
	fail(call->session, "speed",
	     json_sprintf("the bit rate of %s is set by this computer's administrator, not by "
	                  "drivebridge: ip link set %s down; ip link set %s type can bitrate N; ip "
	                  "link set %s up; or BitRate= in the [CAN] section of its .network file. "
	                  "Then set bitrate = N of this bus, reload, and scan at that one",
	                  bus->interface, bus->interface, bus->interface, bus->interface));
	return false;
}

/* A scan that drives of this bus would notice is refused like a command to them. */
static bool may_command(const struct db_call *call, const struct db_bus_config *bus,
                        const struct db_scan_plan *plan)
{
	struct db_session *session = call->session;
	struct db_registers *registers = session->control->setup.registers;
	struct db_named_drive drive;
	char reason[64 + NAME_MAX_LENGTH];

	for (size_t i = 0; i < db_named_drive_count(registers); i++) {
		if (!db_named_drive_at(registers, i, &drive) || drive.bus != bus ||
		    !(plan->aside ||
		      (plan->set_up != DB_INQUIRY_THERE && drive.config->address == plan->first)) ||
		    db_named_may_command(registers, &session->client, drive.number))
			continue;
		snprintf(reason, sizeof(reason), "another client has control of %s",
		         drive.config->name);
		db_session_fail_result(session, DB_RESULT_NOT_IN_CONTROL, reason);
		return false;
	}
	return true;
}

void db_scan_whose(const struct db_control_socket *control, const char *bus,
                   char text[DB_SCAN_WHOSE_MAX])
{
	text[0] = '\0';
	for (size_t i = 0; i < control->count; i++) {
		const struct db_session *session = control->sessions[i];
		const struct wait *wait = session->job;

		if (session->wait == DB_WAITS_FOR_SCAN && wait && strcmp(wait->bus, bus) == 0)
			memcpy(text, wait->whose, DB_SCAN_WHOSE_MAX);
	}
}

/* What begins now, in the audit trail: what it reads, or which drive is told what. */
static void record(struct db_session *session, const struct db_bus_config *bus,
                   const struct db_scan_plan *plan)
{
	static const char *const what[] = {
		[DB_INQUIRY_THERE] = "scan",
		[DB_INQUIRY_SET_ADDRESS] = "address",
		[DB_INQUIRY_SET_SPEED] = "speed",
		[DB_INQUIRY_SAVE] = "save",
	};
	char text[96];

	if (plan->set_up == DB_INQUIRY_THERE)
		snprintf(text, sizeof(text), "addresses %u to %u%s", plan->first, plan->last,
		         plan->speed_count > 0 ? ", with the bus out of service" : "");
	else if (plan->set_up == DB_INQUIRY_SAVE)
		snprintf(text, sizeof(text), "the drive at address %u", plan->first);
	else
		snprintf(text, sizeof(text), "the drive at address %u: %u", plan->first,
		         (unsigned)plan->value);
	db_session_record(session, &(struct db_audit_entry){
					   .kind = DB_AUDIT_SET_UP,
					   .bus = bus->name,
					   .what = what[plan->set_up],
					   .text = text,
				   });
}

/* Its user, as reported by the kernel, for whom that acts, and its program. */
static void write_whose(const struct db_session *session, char text[DB_SCAN_WHOSE_MAX])
{
	char user[DB_CLIENT_TEXT_MAX];
	char program[DB_PROCESS_WORDS_MAX] = "";
	struct db_client_words words;
	struct ucred peer = { .pid = 0 };
	socklen_t length = sizeof(peer);

	db_actors_words(&session->control->actors, session->client.address, &words);
	db_client_words_join(&words, user);
	if (getsockopt(session->fd, SOL_SOCKET, SO_PEERCRED, &peer, &length) == 0 && peer.pid > 0)
		db_process_words(peer.pid, program);
	snprintf(text, DB_SCAN_WHOSE_MAX, "%s%s%s", user, program[0] ? ", " : "", program);
}

static void begin(const struct db_call *call, const struct db_bus_config *bus,
                  struct db_scan_plan *plan)
{
	struct db_session *session = call->session;
	struct db_control_socket *control = session->control;
	struct wait *wait = calloc(1, sizeof(*wait));
	int error = -ENOMEM;

	/* Freed with the answer in any case. */
	session->job = wait;
	if (!may_command(call, bus, plan))
		return;
	if (wait) {
		snprintf(wait->bus, sizeof(wait->bus), "%s", bus->name);
		write_whose(session, wait->whose);
		memcpy(plan->whose, wait->whose, sizeof(plan->whose));
		wait->sets_up = plan->set_up != DB_INQUIRY_THERE;
		error = control->setup.ops->scan(control->setup.context, bus->name, plan,
		                                 &wait->number);
	}
	if (error == -EINVAL)
		db_session_fail_parameter(session, "address, first or last");
	else if (error != 0)
		db_session_fail_result(session, DB_RESULT_BUSY, "");
	/* gcc's analyzer: what is allocated is the session's job, or the answer's. */
	if (error != 0)
		return;
	record(session, bus, plan);
	session->wait = DB_WAITS_FOR_SCAN;
	session->due = db_control_now(control);
}

void db_scan_call(const struct db_call *call)
{
	struct db_scan_plan plan = { .set_up = DB_INQUIRY_THERE };
	const struct db_bus_config *bus;

	if (!db_act_is_allowed(call->session))
		return;
	bus = find_bus(call);
	if (!bus)
		return;
	plan.first = bus->line == DB_LINE_RS232 ? 0 : bus->driver->address_min;
	plan.last = bus->line == DB_LINE_RS232 ? 0 : bus->driver->address_max;
	if (take_number(call, "first", UINT16_MAX, &plan.first) &&
	    take_number(call, "last", UINT16_MAX, &plan.last) && take_speeds(call, bus, &plan))
		begin(call, bus, &plan);
}

void db_scan_set_up(const struct db_call *call)
{
	struct db_scan_plan plan = { .set_up = DB_INQUIRY_THERE };
	const struct db_bus_config *bus;
	const char *what;
	int64_t address;

	if (!db_act_is_allowed(call->session))
		return;
	bus = find_bus(call);
	if (!bus || !db_call_text(call, "what", &what))
		return;
	/* What to set in a drive, and whether its family can be set so. */
	if (strcmp(what, "address") == 0)
		plan.set_up = DB_INQUIRY_SET_ADDRESS;
	else if (strcmp(what, "speed") == 0)
		plan.set_up = DB_INQUIRY_SET_SPEED;
	else if (strcmp(what, "save") == 0)
		plan.set_up = DB_INQUIRY_SAVE;
	else
		db_session_fail_parameter(call->session, "what");
	if ((plan.set_up == DB_INQUIRY_SET_ADDRESS &&
	     bus->driver->address_effect == DB_TAKES_EFFECT_NEVER) ||
	    (plan.set_up == DB_INQUIRY_SET_SPEED &&
	     bus->driver->speed_effect == DB_TAKES_EFFECT_NEVER)) {
		fail(call->session, "refused", json_string(bus->driver->set_up_elsewhere));
		return;
	}
	if (plan.set_up == DB_INQUIRY_THERE ||
	    !db_call_number(call, "address", 0, UINT16_MAX, &address) ||
	    !take_number(call, "value", SPEED_MAX, &plan.value) || !take_speeds(call, bus, &plan))
		return;
	plan.first = plan.last = (unsigned)address;
	/* gcc's analyzer: as in begin(). */
	begin(call, bus, &plan);
}
