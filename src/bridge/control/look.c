/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "codec/secure_hello.h"
#include "control/message.h"
#include "control/values.h"
#include "drivebridge/audit.h"
#include "drivebridge/command_table.h"
#include "drivebridge/health.h"
#include "drivebridge/version.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- what there is ---------------------------------------------------------------------------- */

static json_t *describe_bus(struct db_registers *registers, size_t place)
{
	const struct db_bus_config *config = db_named_bus(registers, place);
	struct db_bus_stats stats;
	static const char *const effects[] = {
		[DB_TAKES_EFFECT_NEVER] = "never",
		[DB_TAKES_EFFECT_AT_ONCE] = "at_once",
		[DB_TAKES_EFFECT_POWER_UP] = "power_up",
	};
	json_t *drives = json_array();
	json_t *speeds = json_array();

	for (size_t i = 0; config->driver->speeds && config->driver->speeds[i] != 0; i++)
		json_array_append_new(speeds, json_integer(config->driver->speeds[i]));
	db_named_bus_stats(registers, place, &stats);
	for (size_t i = 0; i < db_named_drive_count(registers); i++) {
		struct db_named_drive drive;

		if (db_named_drive_at(registers, i, &drive) && drive.bus == config)
			json_array_append_new(drives, json_string(drive.config->name));
	}
	return json_pack(
		"{s:s, s:s, s:I, s:s, s:s, s:I, s:b, s:I, s:b, s:o, s:o, s:s, s:s, s:I, s:I}",
		"name", config->name, "protocol", config->driver->name, "axes",
		(json_int_t)config->driver->axes, "title", config->driver->title, "device",
		config->interface ? config->interface :
		config->device    ? config->device :
				    "",
		"speed",
		(json_int_t)(config->driver->medium == DB_MEDIUM_CAN ? config->bitrate :
	                                                               config->baud),
		"can", config->driver->medium == DB_MEDIUM_CAN, "cycle_ms",
		(json_int_t)config->cycle_ms, "up", stats.up && stats.port.up, "drives", drives,
		"speeds", speeds, "address_effect", effects[config->driver->address_effect],
		"speed_effect", effects[config->driver->speed_effect], "turnaround_us",
		(json_int_t)config->turnaround_us, "drive_latency_ms",
		(json_int_t)config->drive_latency_ms);
}

static json_t *describe_drive(const struct db_named_drive *drive)
{
	static const char *const axes[] = { "x", "y", "z", "a" };
	unsigned axis = drive->config->axis;
	bool has_axis = drive->bus->driver->axes > 0 && axis < sizeof(axes) / sizeof(axes[0]);
	const char *endpoint = drive->config->endpoint_name;
	json_t *description = json_pack(
		"{s:s, s:s, s:I, s:s, s:I, s:s, s:s, s:b}", "name", drive->config->name, "bus",
		drive->bus->name, "address", (json_int_t)drive->config->address, "axis",
		has_axis ? axes[axis] : "", "unit", (json_int_t)drive->config->unit, "unit_name",
		drive->unit, "endpoint", endpoint ? endpoint : "", "controlled", drive->controlled);

	if (!isnan(drive->config->min_position))
		json_object_set_new(description, "min_position",
		                    json_real(drive->config->min_position));
	if (!isnan(drive->config->max_position))
		json_object_set_new(description, "max_position",
		                    json_real(drive->config->max_position));
	return description;
}

/* Null where drivebridge-tls is not there. */
static json_t *describe_secure(const struct db_control_socket *control)
{
	const struct db_control_socket_ops *ops = control->setup.ops;
	struct db_secure_status status;

	if (!ops->secure_status || !ops->secure_status(control->setup.context, &status))
		return json_null();
	return json_pack("{s:I, s:I, s:I, s:I, s:I}", "ends", (json_int_t)status.expires,
	                 "client_ends", (json_int_t)status.client_expires, "list_due",
	                 (json_int_t)status.crl_expires, "clients", (json_int_t)status.clients,
	                 "refused", (json_int_t)status.refused);
}

void db_look_describe(const struct db_call *call)
{
	struct db_control_socket *control = call->session->control;
	struct db_registers *registers = control->setup.registers;
	const struct db_modbus_config *modbus = db_named_modbus(registers);
	json_t *endpoints = json_array();
	json_t *buses = json_array();
	json_t *drives = json_array();
	json_t *description;
	static const char *const names[DB_CONFIGURATION_STATES] = DB_CONFIGURATION_NAMES;
	struct db_configuration_report report;
	struct db_audit_state audit;
	struct db_health *health = *control->setup.health;
	struct db_health_state state = { .on = false };

	for (size_t i = 0; db_named_bus(registers, i); i++)
		json_array_append_new(buses, describe_bus(registers, i));
	for (size_t i = 0; i < db_named_drive_count(registers); i++) {
		struct db_named_drive drive;

		if (db_named_drive_at(registers, i, &drive))
			json_array_append_new(drives, describe_drive(&drive));
	}
	description = json_pack("{s:s, s:s, s:I, s:b, s:o, s:o}", "version", DB_VERSION,
	                        "configuration", control->setup.configuration, "started_us",
	                        (json_int_t)control->started_us, "may_act",
	                        call->session->client.may_write, "buses", buses, "drives", drives);
	/* The running configuration compared with the files. */
	report = control->setup.ops->configuration(control->setup.context);
	json_object_set_new(description, "configuration_state", json_string(names[report.state]));
	json_object_set_new(description, "configuration_since_us",
	                    json_integer((json_int_t)report.since_us));
	json_object_set_new(description, "configuration_messages",
	                    db_message_lines(report.messages));
	json_object_set_new(description, "restart_needed", json_string(report.replaced));
	db_audit_state(*control->setup.audit, &audit);
	json_object_set_new(description, "audit_trouble", json_string(audit.trouble));
	if (health)
		db_health_state(health, &state);
	json_object_set_new(description, "health_trouble", json_string(state.trouble));
	json_object_set_new(description, "secure", describe_secure(control));
	json_object_set_new(description, "listen", json_string(modbus->listen));
	/* The further ones. */
	for (size_t i = 0; i < modbus->endpoint_count; i++)
		json_array_append_new(endpoints,
		                      json_pack("{s:s, s:s}", "name", modbus->endpoints[i].name,
		                                "listen", modbus->endpoints[i].listen));
	json_object_set_new(description, "endpoints", endpoints);
	json_object_set_new(description, "low_word_first", json_boolean(modbus->low_word_first));
	db_session_reply(call->session, description, false);
}

/* Null when there is no memory for the names; the call was answered then. */
static const struct db_name_list *list_of(const struct db_call *call, uint16_t drive, bool windows)
{
	struct db_registers *registers = call->session->control->setup.registers;
	const struct db_name_list *list = windows ? db_named_windows(registers) :
	                                            db_named_registers(registers, drive);

	if (!list)
		db_session_fail_result(call->session, DB_RESULT_BUSY, "");
	return list;
}

/* A drive has up to two hundred, and 150 kB of text: this takes milliseconds, in which Modbus would
 * wait. */
#define REGISTERS_AT_ONCE 16

struct registers_job {
	uint16_t drive;
	uint32_t generation; /* of the registers */
	size_t next;
	bool windows;
};

void db_look_registers(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct registers_job *job;
	struct db_named_drive drive;
	const char *name;
	bool windows = false;

	if (!db_call_drive(call, true, &drive, &name) ||
	    !db_call_optional_flag(call, "windows", &windows))
		return;
	windows = windows && drive.number == DB_NAMED_GATEWAY;
	if (!list_of(call, drive.number, windows))
		return;
	job = calloc(1, sizeof(*job));
	if (!job) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	job->drive = drive.number;
	job->windows = windows;
	job->generation = db_named_generation(session->control->setup.registers);
	session->job = job;
	session->wait = DB_WAITS_FOR_REGISTERS;
	db_look_describe_more(session, db_control_now(session->control));
}

void db_look_describe_more(struct db_session *session, db_time now)
{
	static const char beginning[] = "{\"parameters\":{\"registers\":[";
	static const char end[] = "]}}";
	struct db_registers *registers = session->control->setup.registers;
	struct registers_job *job = session->job;
	const struct db_name_list *list = job->windows ? db_named_windows(registers) :
	                                                 db_named_registers(registers, job->drive);
	char unit[DB_NAMED_UNIT_MAX];
	json_t *one;
	double min;
	double max;

	/* Half an answer cannot be taken back: a client that asks again gets what there is now.
	 * gcc's analyzer does not see that the session has the job, and frees it. */
	if (!list || job->generation != db_named_generation(registers)) {
		session->broken = true;
		return;
	}
	if (job->next == 0)
		db_session_append(session, beginning, sizeof(beginning) - 1, false);
	for (size_t i = 0; i < REGISTERS_AT_ONCE && job->next < list->count; i++) {
		const struct db_entry *entry = &list->entries[job->next];
		char *text;

		db_named_unit(registers, job->drive, entry, unit);
		one = db_values_register(entry, unit);
		if (db_named_limit(registers, job->drive, entry, &min, &max)) {
			json_object_set_new(one, "min", json_real(min));
			json_object_set_new(one, "max", json_real(max));
		}
		text = db_message_text(one);

		if (!text) {
			session->broken = true;
			return;
		}
		if (job->next > 0)
			db_session_append(session, ",", 1, false);
		db_session_append(session, text, strlen(text), false);
		free(text);
		job->next++;
	}
	session->due = now;
	/* gcc's analyzer: the job is the session's, which frees it. */
	if (job->next == list->count)
		db_session_append(session, end, sizeof(end), true);
}

void db_look_commands(const struct db_call *call)
{
	struct db_named_drive drive;
	const struct db_name_list *list;
	const char *name;
	json_t *commands;

	if (!db_call_drive(call, false, &drive, &name))
		return;
	list = list_of(call, drive.number, false);
	if (!list)
		return;
	commands = json_array();
	for (size_t i = 0; i < db_command_row_count; i++) {
		const struct db_command_row *row = &db_command_rows[i];
		json_t *arguments;

		if (!(drive.commands & DB_COMMAND_BIT(row->code)))
			continue;
		arguments = json_array();
		for (size_t a = 0; a < DB_COMMAND_ARGS_MAX && row->args[a] != DB_ARG_NONE; a++) {
			for (size_t r = 0; r < list->count; r++) {
				if (db_named_is_argument(&list->entries[r], row->args[a]))
					json_array_append_new(arguments,
					                      json_string(list->entries[r].name));
			}
		}
		json_array_append_new(commands,
		                      json_pack("{s:s, s:i, s:o, s:b, s:s}", "name", row->name,
		                                "code", (int)row->code, "arguments", arguments,
		                                "stops", db_command_is_stop(row->code),
		                                "description", row->description));
	}
	db_session_reply(call->session, json_pack("{s:o}", "commands", commands), false);
}

/* --- values ----------------------------------------------------------------------------------- */

bool db_look_is_process(const struct db_entry *entry)
{
	/* The first area is the drive's process data; the gateway's own data end before that,
	 * too. */
	return entry->table == DB_TABLE_HOLDING && entry->cell.address <= db_areas[0].last;
}

struct read_answer {
	json_t *values;
	json_t *missing;
	json_t *ages;
	db_time now;
};

static void collect_value(void *context, const char *name, const struct db_entry *entry,
                          const struct db_named_value *value)
{
	struct read_answer *answer = context;

	db_values_collect(answer->values, name, entry, value);
	if (value->kind == DB_NAMED_MISSING)
		json_array_append_new(answer->missing, json_string(name));
	/* The bus's thread may have read it after this turn of the loop began. */
	if (value->told > 0)
		json_object_set_new_nocheck(
			answer->ages, name,
			json_integer(value->told < answer->now ?
		                             (answer->now - value->told) / DB_NS_PER_MS :
		                             0));
}

void db_look_read(const struct db_call *call)
{
	struct db_registers *registers = call->session->control->setup.registers;
	const struct db_entry **entries;
	const struct db_name_list *list;
	struct db_named_drive drive;
	const char *name;
	size_t count = 0;
	json_t *names;
	struct read_answer answer;

	if (!db_call_drive(call, true, &drive, &name) || !db_call_texts(call, "names", &names))
		return;
	list = list_of(call, drive.number, false);
	if (!list)
		return;
	entries = calloc(json_array_size(names) + list->count, sizeof(struct db_entry *));
	if (!entries) {
		db_session_fail_result(call->session, DB_RESULT_BUSY, "");
		return;
	}
	for (size_t i = 0; json_array_size(names) == 0 && i < list->count; i++) {
		if (db_look_is_process(&list->entries[i]))
			entries[count++] = &list->entries[i];
	}
	for (size_t i = 0; i < json_array_size(names); i++) {
		const char *wanted = json_string_value(json_array_get(names, i));

		entries[count] = db_name_list_find(list, wanted);
		if (!entries[count]) {
			db_session_fail_register(call->session, name, wanted);
			free(entries);
			return;
		}
		count++;
	}
	answer = (struct read_answer){
		.values = json_object(),
		.missing = json_array(),
		.ages = json_object(),
		.now = db_control_now(call->session->control),
	};
	db_named_read(registers, &call->session->client, drive.number, entries, count, NULL,
	              collect_value, &answer);
	free(entries);
	db_session_reply(call->session,
	                 json_pack("{s:o, s:o, s:o}", "values", answer.values, "missing",
	                           answer.missing, "ages_ms", answer.ages),
	                 false);
}

void db_look_figures(const struct db_call *call)
{
	struct db_registers *registers = call->session->control->setup.registers;
	json_t *buses = json_object();

	for (size_t i = 0; db_named_bus(registers, i); i++) {
		json_t *figures = json_object();

		db_named_read_bus(registers, i, db_values_collect, figures);
		json_object_set_new(buses, db_named_bus(registers, i)->name, figures);
	}
	db_session_reply(call->session, json_pack("{s:o}", "buses", buses), false);
}
