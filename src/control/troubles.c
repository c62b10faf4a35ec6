/* SPDX-License-Identifier: Apache-2.0 */
#include "control/troubles.h"

#include "control/message.h"
#include "control/state.h"
#include "control/streams.h"
#include "control/values.h"
#include "drivebridge/trouble.h"

#include <stdlib.h>
#include <string.h>

/* How often changes are looked for. */
#define INTERVAL (100 * DB_NS_PER_MS)

#define DRIVES_MAX 247
#define BUSES_MAX 64

/* An event may be logged a moment before what it is about is published. */
#define SLACK_US 100000
/* What a loss is explained with is seen while the drive still answers now and then. */
#define PATTERN_US 60000000

/* What a client was sent last: of another trouble one of these is another. */
struct sent {
	bool sent;
	uint16_t cause;
	db_time since;
	uint64_t event;
};

struct wait {
	uint32_t generation; /* of the registers when the drives were found */
	bool all;
	bool begun;
	bool well;
	size_t drive_count;
	uint16_t drives[DRIVES_MAX];
	struct sent drives_sent[DRIVES_MAX];
	struct sent buses_sent[BUSES_MAX];
	struct sent configuration_sent;
};

/* One trouble, and all that belongs to it. */
struct record {
	enum db_trouble_cause cause;
	db_time since; /* by the clock of the buses */
	uint64_t since_us;
	const char *detail;
	char advice[DB_TROUBLE_ADVICE_MAX];
	bool has_event;
	struct db_log_line event;
};

/* Which events are about a cause. */
static const uint64_t events_about[DB_TROUBLE_COUNT] = {
	[DB_TROUBLE_PORT] = DB_EVENT_BIT(DB_EVENT_BUS_LOST) | DB_EVENT_BIT(DB_EVENT_BUS_OFF),
	[DB_TROUBLE_ASIDE] = DB_EVENT_BIT(DB_EVENT_BUS_ASIDE),
	[DB_TROUBLE_NO_ANSWER] = DB_EVENT_BIT(DB_EVENT_DRIVE_LOST),
	[DB_TROUBLE_NOT_UNDERSTOOD] = DB_EVENT_BIT(DB_EVENT_DRIVE_HEARD),
	[DB_TROUBLE_LATE] = DB_EVENT_BIT(DB_EVENT_DRIVE_LATE),
	[DB_TROUBLE_DEAF] = DB_EVENT_BIT(DB_EVENT_DRIVE_DEAF),
	[DB_TROUBLE_TWO_DRIVES] = DB_EVENT_BIT(DB_EVENT_DRIVE_DOUBLED),
	[DB_TROUBLE_RUNS_ON] = DB_EVENT_BIT(DB_EVENT_DRIVE_RUNS_ON),
	[DB_TROUBLE_FAULT] = DB_EVENT_BIT(DB_EVENT_DRIVE_FAULT),
	[DB_TROUBLE_WATCHDOG] = DB_EVENT_BIT(DB_EVENT_WATCHDOG_TRIPPED),
	[DB_TROUBLE_WARNING] = DB_EVENT_BIT(DB_EVENT_DRIVE_WARNING),
	[DB_TROUBLE_MAY_HAVE_RESTARTED] = DB_EVENT_BIT(DB_EVENT_DRIVE_RESTARTED),
};

/* --- one of them ------------------------------------------------------------------------------------- */

static uint64_t wall_us_of(const struct db_control_socket *control, db_time moment)
{
	struct timespec now;
	db_time age = db_control_now(control) - moment;

	clock_gettime(CLOCK_REALTIME, &now);
	return (uint64_t)now.tv_sec * 1000000 + (uint64_t)now.tv_nsec / 1000 -
	       (uint64_t)(age > 0 ? age / DB_NS_PER_US : 0);
}

/* Drive null: of the bus. */
static void find_event(const struct db_control_socket *control, struct record *record,
                       const char *bus, const char *drive)
{
	bool pattern = record->cause == DB_TROUBLE_LATE || record->cause == DB_TROUBLE_DEAF;
	uint64_t slack = pattern ? PATTERN_US : SLACK_US;

	record->has_event = db_log_latest(control->log.log, events_about[record->cause], bus, drive,
	                                  record->since_us - slack, &record->event);
}

static const char *place_of(const struct db_bus_config *bus)
{
	return bus->interface ? bus->interface : bus->device ? bus->device : "";
}

static void fill_bus(const struct db_control_socket *control, size_t place, struct record *record)
{
	const struct db_bus_config *bus = db_named_bus(control->setup.registers, place);
	struct db_trouble_about about = { .bus = bus->name, .place = place_of(bus) };
	struct db_bus_stats stats;

	db_named_bus_stats(control->setup.registers, place, &stats);
	*record = (struct record){ .detail = "" };
	if (stats.up && stats.port.up)
		return;
	record->cause = stats.aside ? DB_TROUBLE_ASIDE : DB_TROUBLE_PORT;
	record->since = stats.down_since;
	record->since_us = wall_us_of(control, stats.down_since);
	about.port_advice = db_trouble_port_advice(bus->driver->medium == DB_MEDIUM_SERIAL,
	                                           (int)stats.last_error);
	if (!stats.aside && stats.last_error != 0)
		record->detail = strerror((int)stats.last_error);
	db_trouble_advice(record->cause, &about, record->advice);
	find_event(control, record, bus->name, NULL);
}

static size_t place_of_bus(const struct db_registers *registers, const struct db_bus_config *bus)
{
	size_t place = 0;

	while (db_named_bus(registers, place) != bus)
		place++;
	return place;
}

/* False: it is not there any more. */
static bool fill_drive(const struct db_control_socket *control, const struct db_named_drive *drive,
                       struct record *record)
{
	struct db_trouble_about about = {
		.drive = drive->config->name,
		.bus = drive->bus->name,
		.place = place_of(drive->bus),
		.address = drive->config->address,
	};
	struct db_trouble trouble;

	if (!db_named_trouble(control->setup.registers, drive->number, &trouble, &about.error))
		return false;
	/* A drive without its bus is in the bus's trouble. */
	if (trouble.cause == DB_TROUBLE_PORT || trouble.cause == DB_TROUBLE_ASIDE) {
		fill_bus(control, place_of_bus(control->setup.registers, drive->bus), record);
		if (record->cause != DB_TROUBLE_NONE)
			return true;
	}
	*record = (struct record){
		.cause = (enum db_trouble_cause)trouble.cause,
		.since = trouble.since,
		.detail = trouble.cause == DB_TROUBLE_FAULT ? db_error_name(about.error) : "",
	};
	if (record->cause == DB_TROUBLE_NONE)
		return true;
	record->since_us = wall_us_of(control, trouble.since);
	about.late_ms = trouble.late_ms;
	db_trouble_advice(record->cause, &about, record->advice);
	find_event(control, record, drive->bus->name, drive->config->name);
	return true;
}

/* Whether it is another than was sent last; then it is what was. */
static bool is_news(struct sent *sent, const struct record *record)
{
	const struct sent now = {
		.sent = true,
		.cause = (uint16_t)record->cause,
		.since = record->since,
		.event = record->has_event ? record->event.number : 0,
	};
	bool news = !sent->sent || sent->cause != now.cause || sent->since != now.since ||
	            sent->event != now.event;

	*sent = now;
	return news;
}

static json_t *describe(const char *kind, const char *name, const struct record *record)
{
	return json_pack("{s:s, s:s, s:s, s:o, s:I, s:s, s:o}", kind, name, "cause",
	                 db_trouble_name(record->cause), "need",
	                 db_trouble_need_name(db_trouble_need(record->cause)), "detail",
	                 db_values_text(record->detail), "since_us", (json_int_t)record->since_us,
	                 "advice", record->advice, "event",
	                 record->has_event ? db_streams_event(&record->event) : json_null());
}

/* --- all of them ------------------------------------------------------------------------------------- */

static bool is_well(const struct record *record)
{
	return db_trouble_need(record->cause) <= DB_NEED_HINT;
}

/* Those that are news. */
static json_t *collect_drives(const struct db_control_socket *control, struct wait *wait,
                              bool *well)
{
	struct db_registers *registers = control->setup.registers;
	json_t *drives = json_array();
	struct db_named_drive drive;
	struct record record;

	for (size_t i = 0; i < db_named_drive_count(registers); i++) {
		size_t place = 0;

		if (!db_named_drive_at(registers, i, &drive))
			continue;
		while (place < wait->drive_count && wait->drives[place] != drive.number)
			place++;
		if (!fill_drive(control, &drive, &record))
			continue;
		*well = *well && is_well(&record);
		if (place < wait->drive_count && is_news(&wait->drives_sent[place], &record))
			json_array_append_new(drives,
			                      describe("drive", drive.config->name, &record));
	}
	return drives;
}

static json_t *collect_buses(const struct db_control_socket *control, struct wait *wait, bool *well)
{
	struct db_registers *registers = control->setup.registers;
	json_t *buses = json_array();
	struct record record;

	for (size_t i = 0; i < BUSES_MAX && db_named_bus(registers, i); i++) {
		fill_bus(control, i, &record);
		*well = *well && is_well(&record);
		if (is_news(&wait->buses_sent[i], &record))
			json_array_append_new(
				buses, describe("bus", db_named_bus(registers, i)->name, &record));
	}
	return buses;
}

/* What to do about each of its states. */
static const struct {
	const char *cause;
	enum db_trouble_need need;
	const char *advice;
} of_configuration[DB_CONFIGURATION_STATES] = {
	[DB_CONFIGURATION_IN_FORCE] = { "none", DB_NEED_NOTHING, "" },
	[DB_CONFIGURATION_REFUSED] = { "refused", DB_NEED_ACT,
	                               "what runs goes on, but a restart would not run it; correct the "
	                               "file, check it with drivebridged --check, and reload" },
	[DB_CONFIGURATION_LAST_GOOD] = { "last_good", DB_NEED_ACT,
	                                 "a start found the file wrong, so the configuration that was "
	                                 "in force last runs; correct the file, check it with "
	                                 "drivebridged --check, and reload" },
	[DB_CONFIGURATION_CHANGED] = { "changed", DB_NEED_HINT,
	                               "the file is right and not loaded yet: drivebridgectl reload" },
};

#define CONFIGURATION_EVENTS                                                          \
	(DB_EVENT_BIT(DB_EVENT_RELOAD_FAILED) | DB_EVENT_BIT(DB_EVENT_CONFIG_WRONG) | \
	 DB_EVENT_BIT(DB_EVENT_CONFIG_CHANGED) | DB_EVENT_BIT(DB_EVENT_CONFIG_LAST_GOOD))

static json_t *collect_configuration(const struct db_control_socket *control, struct wait *wait,
                                     bool *news, bool *well)
{
	struct db_configuration_report report = control->setup.ops->configuration(
		control->setup.context);
	/* Only to know what is news: the causes are those of drives. */
	struct record record = {
		.detail = "",
		.cause = (enum db_trouble_cause)report.state,
		.since = (db_time)report.since_us,
	};
	bool in_force = report.state == DB_CONFIGURATION_IN_FORCE;
	bool wrong = of_configuration[report.state].need == DB_NEED_ACT;

	if (!in_force)
		record.has_event = db_log_latest(control->log.log, CONFIGURATION_EVENTS, "", NULL,
		                                 report.since_us - SLACK_US, &record.event);
	*well = *well && of_configuration[report.state].need <= DB_NEED_HINT;
	*news = is_news(&wait->configuration_sent, &record) || *news;
	return json_pack("{s:s, s:s, s:I, s:s, s:o, s:o}", "cause",
	                 of_configuration[report.state].cause, "need",
	                 db_trouble_need_name(of_configuration[report.state].need), "since_us",
	                 in_force ? (json_int_t)0 : (json_int_t)report.since_us, "advice",
	                 of_configuration[report.state].advice, "errors",
	                 db_message_lines(wrong ? report.messages : ""), "event",
	                 record.has_event ? db_streams_event(&record.event) : json_null());
}

/* Which drives, also after a reload: then all of them are news. */
static void find_drives(struct db_session *session, struct wait *wait)
{
	struct db_registers *registers = session->control->setup.registers;
	struct db_named_drive drive;

	wait->generation = db_named_generation(registers);
	memset(wait->drives_sent, 0, sizeof wait->drives_sent);
	memset(wait->buses_sent, 0, sizeof wait->buses_sent);
	if (wait->all)
		wait->drive_count = 0;
	for (size_t i = 0; wait->all && i < db_named_drive_count(registers); i++) {
		if (wait->drive_count < DRIVES_MAX && db_named_drive_at(registers, i, &drive))
			wait->drives[wait->drive_count++] = drive.number;
	}
}

static void send_news(struct db_session *session, struct wait *wait)
{
	const struct db_control_socket *control = session->control;
	bool well = true;
	bool news = !wait->begun;
	json_t *drives = collect_drives(control, wait, &well);
	json_t *buses = collect_buses(control, wait, &well);
	json_t *configuration = collect_configuration(control, wait, &news, &well);

	news = news || well != wait->well || json_array_size(drives) > 0 ||
	       json_array_size(buses) > 0;
	wait->well = well;
	wait->begun = true;
	if (!news) {
		json_decref(drives);
		json_decref(buses);
		json_decref(configuration);
		return;
	}
	db_session_reply(session,
	                 json_pack("{s:o, s:o, s:o, s:b}", "drives", drives, "buses", buses,
	                           "configuration", configuration, "well", well),
	                 session->more);
}

void db_troubles_call(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_registers *registers = session->control->setup.registers;
	struct db_named_drive drive;
	struct wait *wait;
	json_t *drives;

	if (!db_call_texts(call, "drives", &drives))
		return;
	wait = json_array_size(drives) <= DRIVES_MAX ? calloc(1, sizeof *wait) : NULL;
	if (!wait) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	session->job = wait;
	wait->all = json_array_size(drives) == 0;
	find_drives(session, wait);
	for (size_t i = 0; i < json_array_size(drives); i++) {
		const char *name = json_string_value(json_array_get(drives, i));

		if (!db_named_drive_find(registers, name, &drive)) {
			db_session_fail_drive(session, name);
			return;
		}
		wait->drives[wait->drive_count++] = drive.number;
	}
	if (session->more) {
		session->wait = DB_WAITS_FOR_TROUBLES;
		session->due = db_control_now(session->control) + INTERVAL;
	}
	send_news(session, wait);
}

void db_troubles_look(struct db_session *session, db_time now)
{
	struct wait *wait = session->job;

	session->due = now + INTERVAL;
	/* A slow reader gets what is true when he reads. */
	if (session->out)
		return;
	if (wait->generation != db_named_generation(session->control->setup.registers))
		find_drives(session, wait);
	send_news(session, wait);
}
