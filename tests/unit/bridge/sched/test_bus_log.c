/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The lines that users read of a bus and its drives: every event has its text, and every cause of a
 * lost port its advice. A log that keeps its lines in memory.
 */
#include "codec/can.h"
#include "driver/list.h"
#include "log/log_private.h"
#include "sched/bus_log.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define LINES 16

struct reader {
	size_t count;
	struct db_log_record lines[LINES];
};

static void take(void *context, const struct db_log_record *record)
{
	struct reader *reader = context;

	if (reader->count < LINES)
		reader->lines[reader->count++] = *record;
}

/* One event of a drive at address 7, as the only line of a log. */
static void tell_event(struct reader *reader, enum db_event event,
                       const struct db_feedback *feedback, const struct db_outage *outage)
{
	const struct db_drive_config drive = {
		.name = (char *)"feeder",
		.unit = 3,
		.address = 7,
		.counts_per_unit = 10.0,
		.unit_name = (char *)"mm",
	};
	struct db_log_source source = { .bus = "press", .level = DB_LOG_INFO };

	memset(reader, 0, sizeof *reader);
	assert_int_equal(db_log_new_to(take, reader, &source.log), 0);
	bus_log_event(&source, &db_driver_servo_can, &drive, event, feedback, outage, 1);
	db_log_free(source.log);
}

static void assert_logged(enum db_event event, const struct db_feedback *feedback,
                          const char *words)
{
	static struct reader reader;

	tell_event(&reader, event, feedback, NULL);
	assert_int_equal(reader.count, 1);
	assert_non_null(strstr(reader.lines[0].text, words));
}

static void a_drive_that_is_found_tells_what_it_does(void **state)
{
	struct db_feedback feedback = { .position = -250, .status = DB_STATUS_ENABLED };

	(void)state;
	assert_logged(DB_EVENT_DRIVE_ONLINE, &feedback,
	              "answers at address 7: enabled, standing, position -25 mm, error none");
	feedback.status = DB_STATUS_MOVING;
	feedback.velocity = 15.0f;
	assert_logged(DB_EVENT_DRIVE_ONLINE, &feedback,
	              "disabled, moving at 1.5 mm/s, position -25 mm");
}

static void the_end_of_an_outage_tells_its_length_and_cause(void **state)
{
	static struct reader reader;
	const struct db_feedback feedback = { .status = DB_STATUS_ENABLED };
	const struct db_outage outage = {
		.cause = DB_TROUBLE_NO_ANSWER,
		.time = 2130 * DB_NS_PER_MS,
	};

	(void)state;
	tell_event(&reader, DB_EVENT_DRIVE_ONLINE, &feedback, &outage);
	assert_non_null(
		strstr(reader.lines[0].text,
	               "answers at address 7 again, after 2.1 s (no_answer): enabled, standing"));
}

/* What the drive knows of its mechanics goes before a default. */
static void a_drive_that_knows_its_units_is_told_in_them(void **state)
{
	const struct db_feedback feedback = { .position = 100, .counts_per_unit = 4.0f };

	(void)state;
	assert_logged(DB_EVENT_DRIVE_ONLINE, &feedback, "position 25 mm");
}

static void a_fault_is_told_with_what_to_check(void **state)
{
	struct db_feedback feedback = { .error = DB_ERROR_DRIVE_FAULT + 8, .drive_status = 0xAB };

	(void)state;
	assert_logged(DB_EVENT_DRIVE_FAULT, &feedback, "check the motor cable, then clear_fault");
	assert_logged(DB_EVENT_DRIVE_FAULT, &feedback, "status 000000AB");
	feedback.error = UINT16_MAX;
	assert_logged(DB_EVENT_DRIVE_FAULT, &feedback, "see the drive's manual, then clear_fault");
}

static void every_event_of_a_drive_has_its_words(void **state)
{
	const struct db_feedback feedback = { .fault_bits = 0x12 };
	const struct db_feedback silent = { .doubt = DB_DOUBT_SILENT };
	const struct db_feedback sign = { .doubt = DB_DOUBT_SIGN };

	(void)state;
	assert_logged(DB_EVENT_DRIVE_LOST, &feedback, "does not answer at address 7");
	assert_logged(DB_EVENT_DRIVE_FAULT_GONE, &feedback, "reports no fault any more");
	assert_logged(DB_EVENT_DRIVE_WARNING, &feedback, "fault bits 0012");
	assert_logged(DB_EVENT_DRIVE_UNCONFIRMED, &feedback, "it may still move");
	assert_logged(DB_EVENT_DRIVE_RESTARTED, &feedback, "was restarted");
	assert_logged(DB_EVENT_DRIVE_MAY_HAVE_RESTARTED, &silent,
	              "was silent and may have been restarted: ");
	assert_logged(DB_EVENT_DRIVE_MAY_HAVE_RESTARTED, &sign,
	              "shows one sign of a restart and may have been restarted: ");
}

static void events_of_others_are_not_told_of_a_drive(void **state)
{
	const struct db_feedback feedback = { .taken = 1 };
	struct reader reader;

	(void)state;
	tell_event(&reader, DB_EVENT_BUS_UP, &feedback, NULL);
	assert_int_equal(reader.count, 0);
}

/* The one line that `tell` logs, without the names of the bus and the drive at its beginning. */
static const char *line_of(void (*tell)(const struct db_log_source *source,
                                        const struct db_drive_config *drive, const void *what),
                           const struct db_drive_config *drive, const void *what)
{
	static const char whose[] = "bus press: drive feeder: ";
	static struct reader reader;
	struct db_log_source source = { .bus = "press", .level = DB_LOG_INFO };

	memset(&reader, 0, sizeof reader);
	assert_int_equal(db_log_new_to(take, &reader, &source.log), 0);
	tell(&source, drive, what);
	db_log_free(source.log);
	assert_int_equal(reader.count, 1);
	assert_memory_equal(reader.lines[0].text, whose, strlen(whose));
	return reader.lines[0].text + strlen(whose);
}

static struct db_drive_config feeder = { .name = (char *)"feeder",
	                                 .unit = 3,
	                                 .address = 7,
	                                 .stop_reaction_ms = 400,
	                                 .counts_per_unit = 10.0,
	                                 .unit_name = (char *)"mm" };

struct running {
	unsigned axes;
	struct db_feedback feedback;
};

static void tell_runs_on(const struct db_log_source *source, const struct db_drive_config *drive,
                         const void *what)
{
	const struct running *running = what;
	struct db_driver driver = db_driver_servo_can;

	driver.axes = running->axes;
	bus_log_event(source, &driver, drive, DB_EVENT_DRIVE_RUNS_ON, &running->feedback, NULL, 1);
}

/* A stop is for all axes of a controller. Where this axis stands, the line must not call it a
 * danger: another axis may still move. */
static void an_axis_that_stands_is_not_said_to_run_on(void **state)
{
	static const char *const runs = "does not slow down: 1.5 mm/s after 400 ms (status "
					"0000002A); the stop is repeated; switch the drive off";
	struct running running = { .axes = 2,
		                   .feedback = { .status = DB_STATUS_ENABLED, .velocity = 15.0f } };
	struct db_drive_config disabled = feeder;

	(void)state;
	running.feedback.drive_status = 0x2A;
	assert_non_null(strstr(line_of(tell_runs_on, &feeder, &running),
	                       "within 400 ms; this axis stands, the stop is repeated for the "
	                       "others"));
	running.feedback.status |= DB_STATUS_MOVING;
	assert_non_null(strstr(line_of(tell_runs_on, &feeder, &running), runs));
	/* Without other axes it is this drive that runs on, whatever its status says. */
	for (running.axes = 0; running.axes < 2; running.axes++) {
		running.feedback.status = DB_STATUS_ENABLED;
		assert_non_null(strstr(line_of(tell_runs_on, &feeder, &running), runs));
		running.feedback.status |= DB_STATUS_MOVING;
		assert_non_null(strstr(line_of(tell_runs_on, &feeder, &running), runs));
	}
	disabled.on_stop_failure = DB_ON_STOP_FAILURE_DISABLE;
	assert_non_null(strstr(line_of(tell_runs_on, &disabled, &running),
	                       "the stop is repeated, and the drive is disabled; switch"));
}

static const struct db_param named[] = { { .name = "SPD" }, { .name = "ACC" }, { .name = "DEC" } };

struct missing {
	struct db_driver driver;
	uint64_t set[1];
};

static void tell_missing(const struct db_log_source *source, const struct db_drive_config *drive,
                         const void *what)
{
	const struct missing *missing = what;

	bus_log_missing_params(source, drive, &missing->driver, missing->set, 1);
}

static void parameters_that_are_missing_are_named(void **state)
{
	static const char *const lines[] = {
		[1] = "does not report SPD; its",           [2] = "does not report ACC; its",
		[3] = "does not report SPD, ACC; its",      [4] = "does not report DEC; its",
		[5] = "does not report SPD, DEC; its",      [6] = "does not report ACC, DEC; its",
		[7] = "does not report SPD, ACC, DEC; its",
	};
	struct missing missing = { .driver = { .params = named, .param_count = 3 } };

	(void)state;
	for (missing.set[0] = 1; missing.set[0] < 8; missing.set[0]++)
		assert_non_null(
			strstr(line_of(tell_missing, &feeder, &missing), lines[missing.set[0]]));
	/* A bit beyond the family's parameters is ignored. */
	missing.set[0] = 9;
	assert_non_null(strstr(line_of(tell_missing, &feeder, &missing), lines[1]));
}

/* The list of names is cut at the end of its buffer. */
static void a_long_list_of_missing_parameters_is_cut(void **state)
{
	static struct db_param many[64];
	struct missing missing = { .driver = { .params = many, .param_count = 64 },
		                   .set = { UINT64_MAX } };
	const char *text;
	const char *first;

	(void)state;
	for (size_t i = 0; i < 64; i++)
		many[i].name = i == 0 ? "ABCD" : "ABC"; /* the last byte that fits is a comma */
	text = line_of(tell_missing, &feeder, &missing);
	first = strstr(text, "ABC");
	assert_non_null(first);
	assert_ptr_equal(strstr(first, "; its other parameters"), first + 255);
}

struct heard {
	enum db_medium medium;
	bool sent;
	struct db_unusable unusable;
};

static void tell_heard(const struct db_log_source *source, const struct db_drive_config *drive,
                       const void *what)
{
	const struct heard *heard = what;

	bus_log_unusable(source, drive, heard->medium, &heard->unusable, 1);
}

static void tell_raw(const struct db_log_source *source, const struct db_drive_config *drive,
                     const void *what)
{
	const struct heard *heard = what;

	bus_log_raw_frame(source, drive, heard->medium, heard->sent, heard->unusable.bytes,
	                  heard->unusable.length, 1);
}

static struct heard heard_on_can(uint32_t id, uint8_t length)
{
	const struct db_can_frame frame = { .id = id,
		                            .length = length,
		                            .data = { 0x0A, 0x1B, 0x2C, 0x3D, 0x4E, 0x5F, 0x60,
		                                      0x71 } };
	struct heard heard = { .medium = DB_MEDIUM_CAN, .unusable = { .length = sizeof frame } };

	memcpy(heard.unusable.bytes, &frame, sizeof frame);
	heard.unusable.count = 4;
	return heard;
}

static void an_unusable_can_frame_is_written_as_id_and_data(void **state)
{
	struct heard heard = heard_on_can(0x165, 2);

	(void)state;
	assert_non_null(
		strstr(line_of(tell_heard, &feeder, &heard),
	               "answers at address 7, but not as documented: 165#0A1B is no answer to "
	               "what was asked (4 such frames)"));
	heard = heard_on_can(0x5 | DB_CAN_EXTENDED, 8);
	assert_non_null(
		strstr(line_of(tell_heard, &feeder, &heard), ": 00000005#0A1B2C3D4E5F6071 is no"));
	/* A frame has 8 bytes at most: a larger length shows no more. */
	heard = heard_on_can(0x7FF, 15);
	assert_non_null(
		strstr(line_of(tell_heard, &feeder, &heard), ": 7FF#0A1B2C3D4E5F6071 is no"));
	heard = heard_on_can(0x7FF, 0);
	assert_non_null(strstr(line_of(tell_heard, &feeder, &heard), ": 7FF# is no"));
	/* Bytes that are no whole CAN frame are written byte by byte. */
	heard.unusable.length = 4;
	assert_non_null(strstr(line_of(tell_heard, &feeder, &heard), ": FF070000 is no"));
	heard.unusable.length = sizeof heard.unusable.bytes;
	assert_null(strstr(line_of(tell_heard, &feeder, &heard), "... is no"));
}

static void an_unusable_serial_answer_is_written_byte_by_byte(void **state)
{
	struct heard heard = { .medium = DB_MEDIUM_SERIAL };

	(void)state;
	for (size_t i = 0; i < sizeof heard.unusable.bytes; i++)
		heard.unusable.bytes[i] = (uint8_t)(0xA0 + i);
	heard.unusable.length = 3;
	assert_non_null(strstr(line_of(tell_heard, &feeder, &heard), ": A0A1A2 is no"));
	/* 16 bytes are the size of a CAN frame in memory, but these are serial. */
	heard.unusable.length = 16;
	assert_non_null(strstr(line_of(tell_heard, &feeder, &heard),
	                       ": A0A1A2A3A4A5A6A7A8A9AAABACADAEAF is no"));
	heard.unusable.length = 23;
	assert_non_null(strstr(line_of(tell_heard, &feeder, &heard), "B4B5B6 is no"));
	/* All bytes that are kept: the answer may have been longer, as the dots say. */
	heard.unusable.length = 24;
	assert_non_null(strstr(line_of(tell_heard, &feeder, &heard), "B5B6B7... is no"));
}

static void tell_long_raw(const struct db_log_source *source, const struct db_drive_config *drive,
                          const void *what)
{
	bus_log_raw_frame(source, drive, DB_MEDIUM_SERIAL, true, what, 40, 1);
}

static void raw_frames_are_logged(void **state)
{
	const uint8_t bytes[40] = { 0x12, 0x34 };
	struct heard heard = heard_on_can(0x165, 2);

	(void)state;
	heard.sent = true;
	assert_string_equal(line_of(tell_raw, &feeder, &heard),
	                    "is sent a client's raw frame, 165#0A1B");
	heard.sent = false;
	assert_string_equal(line_of(tell_raw, &feeder, &heard),
	                    "answers the raw frame with 165#0A1B");
	heard.medium = DB_MEDIUM_SERIAL;
	heard.unusable.length = 1;
	assert_string_equal(line_of(tell_raw, &feeder, &heard), "answers the raw frame with 65");
	heard.unusable.length = 0;
	assert_non_null(strstr(line_of(tell_raw, &feeder, &heard),
	                       "does not answer the raw frame; whether"));
	assert_string_equal(line_of(tell_long_raw, &feeder, bytes),
	                    "is sent a client's raw frame, "
	                    "123400000000000000000000000000000000000000000000...");
}

static const char *tell_slow(const struct bus_slowness *slow)
{
	static struct reader reader;
	const struct db_bus_config bus = { .cycle_ms = 20 };
	struct db_log_source source = { .bus = "press", .level = DB_LOG_INFO };

	memset(&reader, 0, sizeof reader);
	assert_int_equal(db_log_new_to(take, &reader, &source.log), 0);
	bus_log_slow(&source, &bus, slow, 1);
	db_log_free(source.log);
	assert_int_equal(reader.count, 1);
	return reader.lines[0].text;
}

static void a_busy_computer_is_not_blamed_on_the_bus(void **state)
{
	struct bus_slowness slow = { .overruns = 100, .seconds = 10, .cycle_us = 31000 };

	(void)state;
	assert_non_null(strstr(tell_slow(&slow), "took 31 ms); raise cycle-ms or baud"));
	/* The kernel does not count what takes the whole machine away, and not every kernel counts. */
	slow.overslept = 600 * DB_NS_PER_MS;
	assert_non_null(strstr(tell_slow(&slow), "this computer is busy, the bus waited 600 ms"));
	for (slow.overslept = 500 * DB_NS_PER_MS; slow.overslept > 400 * DB_NS_PER_MS;
	     slow.overslept -= 50 * DB_NS_PER_MS)
		assert_non_null(strstr(tell_slow(&slow), "raise cycle-ms or baud"));
	assert_non_null(strstr(tell_slow(&slow), "raise cycle-ms or baud"));
	slow.waited = 700 * DB_NS_PER_MS;
	assert_non_null(strstr(tell_slow(&slow), "the bus waited 700 ms for a processor; give it"));
	slow.has_priority = true;
	assert_non_null(strstr(tell_slow(&slow), "what else has a real-time priority"));
}

static const char *tell_timing(const struct bus_timing *timing)
{
	static struct reader reader;
	const struct db_bus_config bus = { .drive_latency_ms = 30, .turnaround_us = 1000 };
	const struct db_drive_config drive = { .name = (char *)"feeder", .unit = 1 };
	struct db_log_source source = { .bus = "press", .level = DB_LOG_INFO };

	memset(&reader, 0, sizeof reader);
	assert_int_equal(db_log_new_to(take, &reader, &source.log), 0);
	bus_log_timing(&source, &bus, &drive, timing, 1);
	db_log_free(source.log);
	assert_int_equal(reader.count, 1);
	return reader.lines[0].text;
}

static const char *tell_late(db_time learnt, db_time missed)
{
	return tell_timing(&(struct bus_timing){ .told = { .event = DB_EVENT_DRIVE_LATE,
	                                                   .time = 48 * DB_NS_PER_MS + 1,
	                                                   .learnt = learnt },
	                                         .missed = missed,
	                                         .seconds = 20 });
}

static void a_late_answer_on_a_busy_computer_may_not_be_the_drives(void **state)
{
	(void)state;
	assert_non_null(
		strstr(tell_late(0, 0), "drive-latency-ms = 30 for it; set drive-latency-ms = 73"));
	assert_non_null(strstr(tell_late(64 * DB_NS_PER_MS, 400 * DB_NS_PER_MS),
	                       "waits 64 ms for it; set drive-latency-ms = 64 to keep that"));
	assert_non_null(strstr(tell_late(64 * DB_NS_PER_MS, 401 * DB_NS_PER_MS),
	                       "64 ms for it; this computer is busy, the bus waited 401 ms for a "
	                       "processor in the last 20 s"));
	assert_non_null(
		strstr(tell_timing(&(struct bus_timing){
			       .told = { .event = DB_EVENT_DRIVE_LATE, .time = 49 * DB_NS_PER_MS },
			       .seconds = 20 }),
	               "answers 49 ms after a request, but"));
	/* A millisecond that has begun counts as a whole one. */
	assert_non_null(strstr(tell_late(63 * DB_NS_PER_MS + 1, 0),
	                       "waits 64 ms for it; set drive-latency-ms = 64 to keep that"));
	assert_non_null(strstr(tell_late(0, 900 * DB_NS_PER_MS),
	                       "find out what else runs, and set drive-latency-ms = 73 only if"));
}

/* Whoever is named is looked for first: a drive that receives well is not to be called deaf. */
static void who_does_not_receive_is_said(void **state)
{
	struct bus_timing timing = { .told = { .event = DB_EVENT_DRIVE_DEAF,
		                               .time = DB_NS_PER_MS,
		                               .learnt = 2 * DB_NS_PER_MS - 999 } };

	(void)state;
	assert_non_null(strstr(
		tell_timing(&timing),
		"does not receive requests sent 1000 us after its answers: the bus now waits 2000 us"));
	timing.told.others = true;
	timing.told.learnt = 2 * DB_NS_PER_MS;
	assert_non_null(strstr(
		tell_timing(&timing),
		"requests to other drives sent 1000 us after its answers are lost: the bus now waits "
		"2000 us; set turnaround-us = 2000"));
	timing.told.others = false;
	timing.told.learnt = 0;
	assert_non_null(strstr(tell_timing(&timing), "raise turnaround-us, which is 1000"));
}

static const char *advise(const struct db_bus_config *bus, int error)
{
	static char text[DB_TROUBLE_ADVICE_MAX];

	bus_log_port_advice(bus, error, "", text);
	return text;
}

static void each_cause_of_a_lost_port_has_its_advice(void **state)
{
	static const struct {
		int error;
		const char *word;
	} causes[] = {
		{ ENOENT, "plugged in" },     { ENODEV, "plugged in" },
		{ ENXIO, "plugged in" },      { EACCES, "dialout" },
		{ EPERM, "dialout" },         { ENOTTY, "direction = adapter" },
		{ EBUSY, "another program" }, { EAFNOSUPPORT, "no CAN" },
		{ ETIMEDOUT, "speak SLCAN" }, { EPROTO, "refuses to open" },
		{ ENETDOWN, "is down" },
	};
	const struct db_bus_config serial = { .driver = db_driver_find("vsmd-serial"),
		                              .device = (char *)"/dev/ttyS1" };
	const struct db_bus_config can = { .driver = db_driver_find("vsmd-can") };

	(void)state;
	for (size_t i = 0; i < sizeof causes / sizeof causes[0]; i++)
		assert_non_null(strstr(advise(&serial, causes[i].error), causes[i].word));
	/* The same error means another thing on another kind of bus. */
	assert_non_null(strstr(advise(&serial, ENOBUFS), "flow control"));
	assert_non_null(strstr(advise(&can, ENOBUFS), "termination"));
	assert_string_equal(advise(&can, EIO), "");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_that_is_found_tells_what_it_does),
		cmocka_unit_test(the_end_of_an_outage_tells_its_length_and_cause),
		cmocka_unit_test(a_drive_that_knows_its_units_is_told_in_them),
		cmocka_unit_test(a_fault_is_told_with_what_to_check),
		cmocka_unit_test(every_event_of_a_drive_has_its_words),
		cmocka_unit_test(events_of_others_are_not_told_of_a_drive),
		cmocka_unit_test(an_axis_that_stands_is_not_said_to_run_on),
		cmocka_unit_test(parameters_that_are_missing_are_named),
		cmocka_unit_test(a_long_list_of_missing_parameters_is_cut),
		cmocka_unit_test(an_unusable_can_frame_is_written_as_id_and_data),
		cmocka_unit_test(an_unusable_serial_answer_is_written_byte_by_byte),
		cmocka_unit_test(raw_frames_are_logged),
		cmocka_unit_test(a_busy_computer_is_not_blamed_on_the_bus),
		cmocka_unit_test(a_late_answer_on_a_busy_computer_may_not_be_the_drives),
		cmocka_unit_test(who_does_not_receive_is_said),
		cmocka_unit_test(each_cause_of_a_lost_port_has_its_advice),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
