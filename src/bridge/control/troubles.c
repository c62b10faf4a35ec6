/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "control/message.h"
#include "control/values.h"
#include "drivebridge/clock.h"
#include "drivebridge/hash.h"
#include "drivebridge/trouble.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Interval at which changes are checked. */
#define INTERVAL (100 * DB_NS_PER_MS)

#define DRIVES_MAX 247
#define BUSES_MAX 64

/* An event may be logged a moment before its subject is published. */
#define SLACK_US 100000
/* The cause of a loss shows while the drive still answers now and then. */
#define PATTERN_US 60000000

/* What a client was sent last: if one of these changes, it is a new trouble. */
struct sent {
	bool sent;
	uint16_t cause;
	uint64_t words; /* a hash of its texts */
	db_time since;
	uint64_t event;
};

struct wait {
	uint32_t generation; /* generation of the registers when the drives were found */
	bool all;
	bool begun;
	bool well;
	uint64_t newest; /* line of the log at the last check */
	bool logged;     /* there are newer lines in this check */
	size_t drive_count;
	uint16_t drives[DRIVES_MAX];
	struct sent drives_sent[DRIVES_MAX];
	struct sent buses_sent[BUSES_MAX];
	struct sent configuration_sent;
};

/* One trouble with all its data. */
struct record {
	enum db_trouble_cause cause;
	db_time since; /* by the clock of the buses */
	uint64_t since_us;
	char detail[DB_SCAN_WHOSE_MAX];
	char advice[DB_TROUBLE_ADVICE_MAX];
	const char *bus;   /* its event's bus; ... */
	const char *drive; /* ... and drive; null: of the bus */
	bool has_event;
	struct db_log_line event;
};

/* The events that belong to a cause. */
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
	[DB_TROUBLE_MAY_HAVE_RESTARTED] = DB_EVENT_BIT(DB_EVENT_DRIVE_MAY_HAVE_RESTARTED),
	[DB_TROUBLE_ORIGIN_LOST] = DB_EVENT_BIT(DB_EVENT_DRIVE_RESTARTED),
};

/* --- one of them ------------------------------------------------------------------------------ */

static void fill_bus(const struct db_control_socket *control, size_t place, struct record *record)
{
	const struct db_bus_config *bus = db_named_bus(control->setup.registers, place);
	struct db_trouble_about about = { .bus = bus->name };
	char port[DB_TROUBLE_ADVICE_MAX];
	char scan[DB_SCAN_WHOSE_MAX];
	struct db_bus_stats stats;

	db_named_bus_stats(control->setup.registers, place, &stats);
	*record = (struct record){
		.cause = db_trouble_of_bus(stats.up && stats.port.up, stats.aside),
	};
	if (record->cause == DB_TROUBLE_NONE)
		return;
	record->bus = bus->name;
	record->since = stats.down_since;
	record->since_us = db_clock_wall_us_of(stats.down_since, db_control_now(control),
	                                       db_clock_wall_us());
	db_trouble_port_advice(bus->driver->medium == DB_MEDIUM_SERIAL, (int)stats.last_error,
	                       bus->device, stats.holder, port);
	about.port_advice = port;
	db_scan_whose(control, bus->name, scan);
	about.scan = scan;
	if (stats.aside)
		memcpy(record->detail, scan, sizeof(record->detail));
	else if (stats.last_error != 0)
		snprintf(record->detail, sizeof(record->detail), "%s",
		         strerror((int)stats.last_error));
	db_trouble_advice(record->cause, &about, record->advice);
}

/* False: it is no longer there. */
static bool fill_drive(const struct db_control_socket *control, const struct db_named_drive *drive,
                       struct record *record)
{
	struct db_trouble_about about = {
		.drive = drive->config->name,
		.bus = drive->bus->name,
		.address = drive->config->address,
		.driver = drive->bus->driver,
	};
	char error[DB_ERROR_TEXT_MAX];
	struct db_trouble trouble;

	if (!db_named_trouble(control->setup.registers, drive->number, &trouble, &about.error))
		return false;
	/* The trouble of the bus covers a drive without its bus. */
	if (trouble.cause == DB_TROUBLE_PORT || trouble.cause == DB_TROUBLE_ASIDE) {
		size_t place = 0;

		while (db_named_bus(control->setup.registers, place) != drive->bus)
			place++;
		fill_bus(control, place, record);
		if (record->cause != DB_TROUBLE_NONE)
			return true;
	}
	*record = (struct record){
		.cause = (enum db_trouble_cause)trouble.cause,
		.since = trouble.since,
		.bus = drive->bus->name,
		.drive = drive->config->name,
	};
	if (record->cause == DB_TROUBLE_FAULT)
		snprintf(record->detail, sizeof(record->detail), "%s",
		         db_error_text(about.driver, about.error, error));
	if (record->cause == DB_TROUBLE_NONE)
		return true;
	record->since_us = db_clock_wall_us_of(trouble.since, db_control_now(control),
	                                       db_clock_wall_us());
	about.late_ms = trouble.late_ms;
	db_trouble_advice(record->cause, &about, record->advice);
	return true;
}

/* True if it differs from the one sent last; then it replaces that. */
static bool is_news(struct sent *sent, const struct record *record)
{
	uint64_t words = db_hash_add(DB_HASH_BEGIN, record->advice, strlen(record->advice));
	const struct sent now = {
		.sent = true,
		.cause = (uint16_t)record->cause,
		.words = db_hash_add(words, record->detail, strlen(record->detail)),
		.since = record->since,
		.event = record->has_event ? record->event.number : sent->event,
	};
	bool news = !sent->sent || sent->cause != now.cause || sent->words != now.words ||
	            sent->since != now.since || sent->event != now.event;

	*sent = now;
	return news;
}

/* As is_news(), with its event. While the log has nothing new, and nothing else is, there is no
 * other event. */
static bool complete_news(const struct db_control_socket *control, const struct wait *wait,
                          struct sent *sent, struct record *record)
{
	bool news = is_news(sent, record);
	bool pattern;
	uint64_t slack;

	if (!news && !wait->logged)
		return false;
	pattern = record->cause == DB_TROUBLE_LATE || record->cause == DB_TROUBLE_DEAF;
	slack = pattern ? PATTERN_US : SLACK_US;
	record->has_event = record->cause != DB_TROUBLE_NONE &&
	                    db_log_latest(control->log.log, events_about[record->cause],
	                                  record->bus, record->drive, record->since_us - slack,
	                                  &record->event);
	return is_news(sent, record) || news;
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

/* --- all of them ------------------------------------------------------------------------------ */

static bool is_well(const struct record *record)
{
	return db_trouble_need(record->cause) <= DB_NEED_HINT;
}

/* The new ones. */
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
		if (place < wait->drive_count &&
		    complete_news(control, wait, &wait->drives_sent[place], &record))
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
		if (complete_news(control, wait, &wait->buses_sent[i], &record))
			json_array_append_new(
				buses, describe("bus", db_named_bus(registers, i)->name, &record));
	}
	return buses;
}

/* What to do in each of its states. */
static const struct {
	const char *cause;
	enum db_trouble_need need;
	const char *advice;
} of_configuration[DB_CONFIGURATION_STATES] = {
	[DB_CONFIGURATION_IN_FORCE] = { "none", DB_NEED_NOTHING, "" },
	[DB_CONFIGURATION_REFUSED] = { "refused", DB_NEED_ACT,
	                               "the loaded configuration stays in force, but a restart "
	                               "would not load the file; correct the "
	                               "file, check it with drivebridged --check, and reload" },
	[DB_CONFIGURATION_LAST_GOOD] = { "last_good", DB_NEED_ACT,
	                                 "THE LAST GOOD CONFIGURATION RUNS, because a start found "
	                                 "the "
	                                 "file wrong; correct the file, check it with drivebridged "
	                                 "--check, and reload" },
	[DB_CONFIGURATION_CHANGED] = { "changed", DB_NEED_HINT,
	                               "the file is right and not loaded yet: drivebridgectl "
	                               "reload" },
};

#define CONFIGURATION_EVENTS                                                          \
	(DB_EVENT_BIT(DB_EVENT_RELOAD_FAILED) | DB_EVENT_BIT(DB_EVENT_CONFIG_WRONG) | \
	 DB_EVENT_BIT(DB_EVENT_CONFIG_CHANGED) | DB_EVENT_BIT(DB_EVENT_CONFIG_LAST_GOOD))

const char *db_troubles_of_configuration(enum db_configuration_state state)
{
	return of_configuration[state].cause;
}

static json_t *collect_configuration(const struct db_control_socket *control, struct wait *wait,
                                     bool *news, bool *well)
{
	struct db_configuration_report report = control->setup.ops->configuration(
		control->setup.context);
	/* Only to detect changes: the causes are those of drives. */
	struct record record = {
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

/* Finds the drives, also after a reload: then all of them are new. */
static void find_drives(struct db_session *session, struct wait *wait)
{
	struct db_registers *registers = session->control->setup.registers;
	struct db_named_drive drive;

	wait->generation = db_named_generation(registers);
	memset(wait->drives_sent, 0, sizeof(wait->drives_sent));
	memset(wait->buses_sent, 0, sizeof(wait->buses_sent));
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
	uint64_t newest = db_log_newest(control->log.log);
	json_t *drives;
	json_t *buses;
	json_t *configuration;

	wait->logged = newest != wait->newest;
	wait->newest = newest;
	drives = collect_drives(control, wait, &well);
	buses = collect_buses(control, wait, &well);
	configuration = collect_configuration(control, wait, &news, &well);

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
	wait = json_array_size(drives) <= DRIVES_MAX ? calloc(1, sizeof(*wait)) : NULL;
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
	/* A slow reader gets the state at the time of reading. */
	if (session->out)
		return;
	if (wait->generation != db_named_generation(session->control->setup.registers))
		find_drives(session, wait);
	send_news(session, wait);
}
