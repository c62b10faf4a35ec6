/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "codec/secure_hello.h"
#include "control/values.h"
#include "drivebridge/audit.h"
#include "drivebridge/server.h"
#include "drivebridge/version.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One family of samples: a register of every drive, or a figure of every bus, or several of them
 * under one name and distinguished by a label. A row without a help text continues the name of the
 * row before. */
struct metric {
	const char *name;
	const char *type;
	const char *help;
	const char *source; /* name of the register; of a bus: of its figure */
	const char *label;  /* further labels; "" for none */
	double scale;
};

// clang-format off
#define COUNTER(n, h, s, l) { n, "counter", h, s, l, 1.0 }
#define GAUGE(n, h, s, f) { n, "gauge", h, s, "", f }

static const struct metric of_drives[] = {
	GAUGE("drivebridge_drive_quality", "Quality of the process data as in OPC: 0 bad, 64 uncertain, 192 good.",
	      "quality", 1.0),
	GAUGE("drivebridge_drive_age_seconds", "Age of the process data; not there before the first.", "age_ms", 1e-3),
	GAUGE("drivebridge_drive_axis_state",
	      "State after PLCopen: 0 Offline, 1 Disabled, 2 Standstill, 3 DiscreteMotion, 4 ContinuousMotion, "
	      "5 Homing, 6 Stopping, 7 ErrorStop.", "axis_state", 1.0),
	GAUGE("drivebridge_drive_error", "Why it is in ErrorStop or Offline, as the register error; 0 for nothing.",
	      "error", 1.0),
	GAUGE("drivebridge_drive_params_unsaved",
	      "Whether it holds parameters that it would lose without power, as far as the service knows.",
	      "params_unsaved", 1.0),
	GAUGE("drivebridge_drive_must_stand_cause",
	      "Why it must stand without having been seen to, as the register must_stand_cause; 0 for nothing.",
	      "must_stand_cause", 1.0),
	GAUGE("drivebridge_drive_must_stand_seconds", "For how long; 0 when it need not.", "must_stand_ms", 1e-3),
	GAUGE("drivebridge_drive_position", "Position in the user's units.", "position_units", 1.0),
	GAUGE("drivebridge_drive_velocity", "Velocity in the user's units per second.", "velocity_units", 1.0),
	GAUGE("drivebridge_drive_round_trip_seconds", "Last round trip: first byte out to last byte in.",
	      "round_trip_us", 1e-6),
	GAUGE("drivebridge_drive_round_trip_max_seconds", "Longest round trip.", "round_trip_max_us", 1e-6),
	GAUGE("drivebridge_drive_round_trip_mean_seconds", "Mean round trip.", "round_trip_mean_us", 1e-6),
	COUNTER("drivebridge_drive_requests_total", "Requests sent to the drive.", "requests", ""),
	COUNTER("drivebridge_drive_answers_total", "Answers received from it.", "answers", ""),
	COUNTER("drivebridge_drive_retries_total", "Requests repeated.", "retries", ""),
	COUNTER("drivebridge_drive_errors_total", "What went wrong, by kind.", "timeouts", ",kind=\"timeout\""),
	COUNTER("drivebridge_drive_errors_total", NULL, "bad_frames", ",kind=\"bad_frame\""),
	COUNTER("drivebridge_drive_errors_total", NULL, "refusals", ",kind=\"refusal\""),
	COUNTER("drivebridge_drive_came_online_total", "How often it came online.", "came_online", ""),
	COUNTER("drivebridge_watchdog_trips_total", "How often the watchdog stopped the drive.", "watchdog_trips", ""),
};

static const struct metric of_buses[] = {
	GAUGE("drivebridge_bus_up", "Whether the port is open.", "up", 1.0),
	GAUGE("drivebridge_bus_period_seconds", "Configured cycle.", "period_us", 1e-6),
	GAUGE("drivebridge_bus_cycle_seconds", "Time the last cycle took.", "cycle_us", 1e-6),
	GAUGE("drivebridge_bus_cycle_max_seconds", "Longest cycle.", "cycle_max_us", 1e-6),
	GAUGE("drivebridge_bus_jitter_seconds", "Lateness of the last cycle's start.", "jitter_us", 1e-6),
	GAUGE("drivebridge_bus_jitter_max_seconds", "Largest lateness.", "jitter_max_us", 1e-6),
	GAUGE("drivebridge_bus_utilisation_ratio", "Part of the last second in which the wire was busy or waited for.",
	      "utilisation", 1e-3),
	GAUGE("drivebridge_bus_queued", "Commands waiting now.", "queued", 1.0),
	GAUGE("drivebridge_bus_drives_online", "Drives online now.", "online", 1.0),
	COUNTER("drivebridge_bus_cycles_total", "Cycles run.", "cycles", ""),
	COUNTER("drivebridge_bus_overruns_total", "Cycles that had not ended when the next was due.", "overruns", ""),
	COUNTER("drivebridge_bus_transactions_total", "Exchanges on the wire.", "transactions", ""),
	COUNTER("drivebridge_bus_retries_total", "Exchanges repeated.", "retries", ""),
	COUNTER("drivebridge_bus_errors_total", "What went wrong, by kind.", "timeouts", ",kind=\"timeout\""),
	COUNTER("drivebridge_bus_errors_total", NULL, "bad_frames", ",kind=\"bad_frame\""),
	COUNTER("drivebridge_bus_errors_total", NULL, "stray_frames", ",kind=\"stray_frame\""),
	COUNTER("drivebridge_bus_errors_total", NULL, "line_bus_offs", ",kind=\"bus_off\""),
	COUNTER("drivebridge_bus_errors_total", NULL, "line_error_passives", ",kind=\"error_passive\""),
	COUNTER("drivebridge_bus_errors_total", NULL, "line_arbitration_lost", ",kind=\"arbitration_lost\""),
	COUNTER("drivebridge_bus_errors_total", NULL, "line_line_errors", ",kind=\"line_error\""),
	COUNTER("drivebridge_bus_errors_total", NULL, "line_overflows", ",kind=\"overflow\""),
	COUNTER("drivebridge_bus_errors_total", NULL, "line_refused", ",kind=\"adapter_refused\""),
	COUNTER("drivebridge_bus_garbage_bytes_total", "Bytes outside of frames.", "garbage_bytes", ""),
	COUNTER("drivebridge_bus_reports_total", "Frames that drives sent by themselves and that were used.", "reports",
	        ""),
	COUNTER("drivebridge_bus_opens_total", "How often the port was opened.", "opens", ""),
};
// clang-format on

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

static void put_head(FILE *out, const char *name, const char *type, const char *help)
{
	fprintf(out, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, type);
}

/* Data of one drive or bus, and its labels. */
struct subject {
	json_t *values;
	char labels[128];
};

static void put_samples(FILE *out, const struct metric *metrics, size_t metric_count,
                        const struct subject *subjects, size_t count)
{
	for (size_t m = 0; m < metric_count; m++) {
		const struct metric *metric = &metrics[m];

		if (metric->help)
			put_head(out, metric->name, metric->type, metric->help);
		for (size_t i = 0; i < count; i++) {
			const json_t *value = json_object_get(subjects[i].values, metric->source);
			double number = json_is_true(value) ? 1.0 : json_number_value(value);

			/* An unknown value has no sample: 4294967295 ms is no age. */
			if (!(json_is_number(value) || json_is_boolean(value)) ||
			    (strcmp(metric->source, "age_ms") == 0 && number >= UINT32_MAX))
				continue;
			fprintf(out, "%s{%s%s} %.12g\n", metric->name, subjects[i].labels,
			        metric->label, number * metric->scale);
		}
	}
}

static size_t read_drives(struct db_session *session, struct subject *subjects)
{
	struct db_registers *registers = session->control->setup.registers;
	struct db_client nobody = session->client;
	size_t count = 0;

	/* Reading everything must not keep anything moving. */
	nobody.may_write = false;
	for (size_t i = 0; i < db_named_drive_count(registers); i++) {
		const struct db_entry *entries[COUNT_OF(of_drives)];
		const struct db_name_list *list;
		struct db_named_drive drive;
		size_t entry_count = 0;

		if (!db_named_drive_at(registers, i, &drive))
			continue;
		list = db_named_registers(registers, drive.number);
		for (size_t m = 0; list && m < COUNT_OF(of_drives); m++) {
			entries[entry_count] = db_name_list_find(list, of_drives[m].source);
			entry_count += entries[entry_count] != NULL;
		}
		subjects[count].values = json_object();
		snprintf(subjects[count].labels, sizeof(subjects[count].labels),
		         "bus=\"%s\",drive=\"%s\"", drive.bus->name, drive.config->name);
		db_named_read(registers, &nobody, drive.number, entries, entry_count, NULL,
		              db_values_collect, subjects[count].values);
		count++;
	}
	return count;
}

static size_t read_buses(struct db_registers *registers, struct subject *subjects)
{
	size_t count = 0;

	for (; db_named_bus(registers, count); count++) {
		subjects[count].values = json_object();
		snprintf(subjects[count].labels, sizeof(subjects[count].labels), "bus=\"%s\"",
		         db_named_bus(registers, count)->name);
		db_named_read_bus(registers, count, db_values_collect, subjects[count].values);
	}
	return count;
}

static void free_subjects(struct subject *subjects, size_t count)
{
	for (size_t i = 0; subjects && i < count; i++)
		json_decref(subjects[i].values);
	free(subjects);
}

static void put_one(FILE *out, const char *name, const char *type, const char *help, double value)
{
	put_head(out, name, type, help);
	fprintf(out, "%s %.15g\n", name, value);
}

/* The exceptions of Modbus: 07 to 09 are of functions that are not served. */
static const uint8_t exception_codes[] = { 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x0A, 0x0B };

static void put_modbus(FILE *out, const struct db_server_stats *stats)
{
	put_one(out, "drivebridge_modbus_clients", "gauge", "Modbus TCP clients connected.",
	        stats->clients);
	put_one(out, "drivebridge_modbus_clients_peak", "gauge", "The most there were at once.",
	        stats->clients_peak);
	put_one(out, "drivebridge_modbus_accepted_total", "counter", "Connections accepted.",
	        stats->accepted);
	put_head(out, "drivebridge_modbus_refused_total", "counter",
	         "Connections and writes refused, by reason.");
	fprintf(out,
	        "drivebridge_modbus_refused_total{reason=\"full\"} %" PRIu32 "\n"
	        "drivebridge_modbus_refused_total{reason=\"address\"} %" PRIu32 "\n"
	        "drivebridge_modbus_refused_total{reason=\"reserved\"} %" PRIu32 "\n"
	        "drivebridge_modbus_refused_total{reason=\"per_address\"} %" PRIu32 "\n"
	        "drivebridge_modbus_refused_total{reason=\"write\"} %" PRIu32 "\n"
	        "drivebridge_modbus_refused_total{reason=\"control\"} %" PRIu32 "\n",
	        stats->refused_full, stats->refused_address, stats->refused_reserved,
	        stats->refused_per_address, stats->refused_writes, stats->refused_control);
	put_one(out, "drivebridge_modbus_requests_total", "counter", "Requests received.",
	        stats->requests);
	put_one(out, "drivebridge_modbus_held_back_total", "counter",
	        "Requests answered later because of max-requests-per-second.", stats->held_back);
	put_head(out, "drivebridge_modbus_exceptions_total", "counter",
	         "Exceptions answered, by code.");
	for (size_t i = 0; i < COUNT_OF(exception_codes); i++)
		fprintf(out, "drivebridge_modbus_exceptions_total{code=\"%02X\"} %" PRIu32 "\n",
		        exception_codes[i], stats->exceptions_by_code[exception_codes[i]]);
	put_one(out, "drivebridge_modbus_bad_frames_total", "counter",
	        "Connections closed for what cannot be Modbus.", stats->bad_frames);
	put_one(out, "drivebridge_modbus_timeouts_total", "counter",
	        "Connections closed for an unfinished frame or idling.", stats->timeouts);
}

struct line_metric {
	const char *name;
	const char *help;
	size_t offset;
};

#define LINE_METRIC(n, member, text)                             \
	{                                                        \
		n, text, offsetof(struct db_server_line, member) \
	}

/* Nothing where there is no line. */
static void put_lines(FILE *out, const struct db_control_socket *control)
{
	static const struct line_metric counters[] = {
		LINE_METRIC("requests", requests,
		            "Requests for units of the gateway, and broadcasts."),
		LINE_METRIC("answers", answers, "Answers sent."),
		LINE_METRIC("repeated", repeated,
		            "Requests that repeated one in progress, and were not executed again."),
		LINE_METRIC("late", late, "Answers not sent: the PLC did not wait any longer."),
		LINE_METRIC("missed", missed,
		            "Requests not executed: another one came before they were taken."),
		LINE_METRIC("foreign", foreign, "Frames for, or from, other devices of the line."),
		LINE_METRIC("bad", bad,
		            "Bytes that were no frames, such as those with a wrong CRC."),
		LINE_METRIC("overruns", overruns, "More bytes without a silence than frames have."),
		LINE_METRIC("echoes", echoes, "Frames received that were sent."),
	};
	const struct db_control_socket_ops *ops = control->setup.ops;
	struct db_server_line line;

	if (!ops->line || !ops->line(control->setup.context, 0, &line))
		return;
	put_head(out, "drivebridge_modbus_rtu_up", "gauge",
	         "Whether the port of the line is open.");
	for (size_t i = 0; ops->line(control->setup.context, i, &line); i++)
		fprintf(out, "drivebridge_modbus_rtu_up{line=\"%s\"} %d\n", line.name, line.up);
	for (size_t m = 0; m < COUNT_OF(counters); m++) {
		char name[64];

		snprintf(name, sizeof(name), "drivebridge_modbus_rtu_%s_total", counters[m].name);
		put_head(out, name, "counter", counters[m].help);
		for (size_t i = 0; ops->line(control->setup.context, i, &line); i++) {
			uint32_t value;

			memcpy(&value, (const char *)&line + counters[m].offset, sizeof(value));
			fprintf(out, "%s{line=\"%s\"} %" PRIu32 "\n", name, line.name, value);
		}
	}
}

/* Nothing more where drivebridge-tls is not there. */
static void put_secure(FILE *out, const struct db_control_socket *control)
{
	const struct db_control_socket_ops *ops = control->setup.ops;
	struct db_secure_status status;
	bool there = ops->secure_status && ops->secure_status(control->setup.context, &status);

	put_one(out, "drivebridge_tls_up", "gauge",
	        "Whether drivebridge-tls is connected with the service.", there);
	if (!there)
		return;
	put_head(out, "drivebridge_tls_certificate_expires_timestamp_seconds", "gauge",
	         "When the gateway's certificate ends, the first of a connected client, and when a "
	         "newer list of revoked ones is due; since 1970 in UTC, 0 for none.");
	fprintf(out,
	        "drivebridge_tls_certificate_expires_timestamp_seconds{of=\"own\"} %" PRId64 "\n"
	        "drivebridge_tls_certificate_expires_timestamp_seconds{of=\"client\"} %" PRId64 "\n"
	        "drivebridge_tls_certificate_expires_timestamp_seconds{of=\"list\"} %" PRId64 "\n",
	        status.expires, status.client_expires, status.crl_expires);
	put_one(out, "drivebridge_tls_clients", "gauge", "Clients with certificates.",
	        status.clients);
	put_one(out, "drivebridge_tls_greetings", "gauge", "Greetings that have not ended.",
	        status.greetings);
	put_one(out, "drivebridge_tls_accepted_total", "counter", "Greetings that succeeded.",
	        status.accepted);
	put_one(out, "drivebridge_tls_refused_total", "counter",
	        "Greetings that failed or were not finished.", status.refused);
	put_one(out, "drivebridge_tls_displaced_total", "counter",
	        "Greetings that gave way to others.", status.displaced);
}

static void put_control(FILE *out, const struct db_control_socket *control)
{
	const struct db_control_stats *stats = &control->stats;

	put_one(out, "drivebridge_control_sessions", "gauge", "Sessions of the control socket.",
	        (double)control->count);
	put_one(out, "drivebridge_control_accepted_total", "counter", "Sessions accepted.",
	        (double)stats->accepted);
	put_one(out, "drivebridge_control_refused_total", "counter", "Sessions refused.",
	        (double)stats->refused);
	put_one(out, "drivebridge_control_dropped_total", "counter",
	        "Sessions closed because they did not read their answers.", (double)stats->dropped);
	put_one(out, "drivebridge_control_calls_total", "counter", "Calls received.",
	        (double)stats->calls);
	put_one(out, "drivebridge_control_errors_total", "counter", "Errors answered.",
	        (double)stats->errors);
	put_one(out, "drivebridge_control_denied_total", "counter",
	        "Calls of who may not act, or while another client had control.",
	        (double)stats->denied);
	put_one(out, "drivebridge_control_skipped_total", "counter",
	        "Samples and events left out for slow readers.", (double)stats->skipped);
}

static void put_all(FILE *out, struct db_session *session, struct subject *drives,
                    struct subject *buses)
{
	const struct db_control_socket *control = session->control;
	struct db_registers *registers = control->setup.registers;
	struct db_server_stats modbus = { 0 };
	size_t count;
	struct db_audit_state state;

	put_head(out, "drivebridge_build_info", "gauge", "Always 1; the version is a label.");
	fprintf(out, "drivebridge_build_info{version=\"%s\"} 1\n", DB_VERSION);
	put_one(out, "drivebridge_start_time_seconds", "gauge",
	        "When it started, since 1970 in UTC.", (double)control->started_us / 1e6);
	put_one(out, "drivebridge_configuration_state", "gauge",
	        "Whether the configuration on disk is what runs: 0 it is, 1 it was refused, 2 it "
	        "had an error and the last good one runs, 3 it has changed and is not loaded.",
	        control->setup.ops->configuration(control->setup.context).state);
	put_one(out, "drivebridge_restart_needed", "gauge",
	        "1: an upgrade has replaced the program or a library, and the one of before runs.",
	        control->setup.ops->configuration(control->setup.context).replaced[0] != '\0');
	db_audit_state(*control->setup.audit, &state);
	put_one(out, "drivebridge_audit_records_total", "counter",
	        "Number of the newest audit record.", (double)state.newest);
	put_one(out, "drivebridge_audit_lost_total", "counter",
	        "Audit records that are missing in the files since the start.", (double)state.lost);
	put_one(out, "drivebridge_audit_bytes", "gauge", "What the files of the audit trail take.",
	        (double)state.bytes);
	put_one(out, "drivebridge_audit_failing", "gauge",
	        "1: the files of the audit trail cannot be written.", state.trouble[0] != '\0');
	put_head(out, "drivebridge_drive_up", "gauge", "Whether the drive answers.");
	for (size_t i = 0; i < db_named_drive_count(registers); i++) {
		struct db_named_drive drive;

		if (db_named_drive_at(registers, i, &drive))
			fprintf(out, "drivebridge_drive_up{bus=\"%s\",drive=\"%s\"} %d\n",
			        drive.bus->name, drive.config->name,
			        db_named_online(registers, drive.number));
	}
	count = read_drives(session, drives);
	put_samples(out, of_drives, COUNT_OF(of_drives), drives, count);
	free_subjects(drives, count);
	count = read_buses(registers, buses);
	put_samples(out, of_buses, COUNT_OF(of_buses), buses, count);
	free_subjects(buses, count);
	control->setup.ops->server_stats(control->setup.context, &modbus);
	put_modbus(out, &modbus);
	put_lines(out, control);
	put_secure(out, control);
	put_control(out, control);
}

void db_metrics_call(const struct db_call *call)
{
	struct db_registers *registers = call->session->control->setup.registers;
	size_t drive_count = db_named_drive_count(registers);
	size_t bus_count = 0;
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);
	struct subject *drives = calloc(drive_count + 1, sizeof(drives[0]));
	struct subject *buses;

	while (db_named_bus(registers, bus_count))
		bus_count++;
	buses = calloc(bus_count + 1, sizeof(buses[0]));
	if (out && drives && buses) {
		put_all(out, call->session, drives, buses);
		fclose(out);
		db_session_reply(call->session, json_pack("{s:s}", "text", text), false);
	} else {
		if (out)
			fclose(out);
		free(drives);
		free(buses);
		db_session_fail_result(call->session, DB_RESULT_BUSY, "");
	}
	free(text);
}
