/* SPDX-License-Identifier: Apache-2.0 */
/* What the loop hears: hung threads, completions, signals; and what the registers have logged. */
#include "bench.h"

#include "service/service_private.h"

#include <errno.h>

#define BUS(name) \
	"bus " name " { protocol = vsmd-serial baud = 115200 device = \"/dev/" name "\" }\n"
#define FILE_TEXT BUS("a") BUS("b") "drive d { bus = a address = 1 unit = 7 }\n"

static struct bench bench;

static int begin(void **state)
{
	(void)state;
	begin_service(&bench, FILE_TEXT);
	return 0;
}

static int end(void **state)
{
	(void)state;
	end_service(&bench);
	return 0;
}

static struct db_bus *bus_at(size_t place)
{
	return bench.service.plant->buses[place]->bus;
}

/* --- threads that hang ------------------------------------------------------------------------ */

#define AT(s) ((s)*DB_NS_PER_S)

static void a_hung_thread_is_found_within_half_of_the_patience(void **state)
{
	(void)state;
	bench.service.watchdog = 10 * DB_NS_PER_S;
	assert_true(loop_buses_are_alive(&bench.service, AT(100)));
	bus_at(0)->beats++;
	bus_at(1)->beats++;
	assert_true(loop_buses_are_alive(&bench.service, AT(103)));
	bus_at(0)->beats++;
	assert_true(loop_buses_are_alive(&bench.service, AT(108)));
	expect_never("log");
	/* b has not turned since 103. */
	bus_at(0)->beats++;
	assert_false(loop_buses_are_alive(&bench.service, AT(108) + 1));
	expect_next("log thread-hangs b/-/-: the thread of the bus hangs");
	expect_never("thread-hangs a");
	bus_at(1)->beats++;
	assert_true(loop_buses_are_alive(&bench.service, AT(109)));
}

static void a_bus_that_has_ended_does_not_hang(void **state)
{
	(void)state;
	bench.service.watchdog = 10 * DB_NS_PER_S;
	bus_at(0)->ended = true;
	bus_at(1)->ended = true;
	for (db_time now = 100; now < 200; now += 10)
		assert_true(loop_buses_are_alive(&bench.service, AT(now)));
}

/* The first look is the beginning: how long the thread stood before is not known. */
static void a_bus_that_never_turned_has_its_time_too(void **state)
{
	(void)state;
	bench.service.watchdog = 10 * DB_NS_PER_S;
	assert_true(loop_buses_are_alive(&bench.service, AT(1000)));
	assert_true(loop_buses_are_alive(&bench.service, AT(1005)));
	assert_false(loop_buses_are_alive(&bench.service, AT(1006)));
}

/* --- the loop --------------------------------------------------------------------------------- */

static void completions_are_fetched_when_a_bus_rings(void **state)
{
	(void)state;
	bus_at(1)->completed = true;
	assert_int_equal(eventfd_write(bus_at(1)->fd, 1), 0);
	assert_true(sd_event_run(bench.service.loop, UINT64_MAX) > 0);
	expect_next("fetched of b");
	expect_never("fetched of a");
}

static void sigterm_ends_the_loop(void **state)
{
	(void)state;
	assert_int_equal(raise(SIGTERM), 0);
	assert_int_equal(sd_event_loop(bench.service.loop), EXIT_SUCCESS);
}

static void sigint_ends_the_loop(void **state)
{
	(void)state;
	assert_int_equal(raise(SIGINT), 0);
	assert_int_equal(sd_event_loop(bench.service.loop), EXIT_SUCCESS);
}

static void without_systemd_nobody_feeds_its_watchdog(void **state)
{
	(void)state;
	unsetenv("WATCHDOG_USEC");
	assert_int_equal(loop_feed_watchdog(&bench.service), 0);
	assert_null(bench.service.pulse);
	assert_int_equal(setenv("WATCHDOG_USEC", "10000000", 1), 0);
	assert_true(loop_feed_watchdog(&bench.service) >= 0);
	assert_non_null(bench.service.pulse);
	assert_int_equal(bench.service.watchdog, 10 * DB_NS_PER_S);
	unsetenv("WATCHDOG_USEC");
}

/* --- what is kept and said -------------------------------------------------------------------- */

static void buses_and_reloads_find_descriptors(void **state)
{
	(void)state;
	service_limit_clients(&bench.service);
	assert_int_equal(fake.descriptors_kept, 24 + DB_CONTROL_SOCKET_DESCRIPTORS + 2 * 8);
}

static void the_address_that_is_listened_on_is_logged(void **state)
{
	struct db_modbus_config modbus = { 0 };
	char listen[] = "[fd00::5]:0";

	(void)state;
	modbus.listen = listen;
	service_log_listening(&bench.service, NULL, &modbus);
	expect_next("log listening -/-/-: listening on [fd00::5]:1502");
	expect_never("does not have the address");
	clear_journal();
	fake.early = true;
	service_log_listening(&bench.service, NULL, &modbus);
	expect_next("this machine does not have the address [fd00::5] yet");
	expect_next("listening on [fd00::5]:1502");
}

static void watchdogs_and_refusals_name_bus_drive_and_client(void **state)
{
	const struct db_bus_config *bus = bench.service.plant->buses[0]->config;
	const struct db_drive_config *drive = bench.service.plant->drives[0]->config;
	static const struct db_client client = {
		.id = 3, .address = { [10] = 0xFF, [11] = 0xFF, 192, 168, 0, 7 }
	};
	static const struct {
		struct db_refused_write write;
		const char *line;
	} refusals[] = {
		{ { .command = DB_CMD_HOME, .address = 9, .result = DB_RESULT_REFUSED },
		  "command home is refused: refused (result" },
		{ { .address = 135, .param = "spd", .result = DB_RESULT_OUT_OF_RANGE },
		  "a write to register 135 is refused: out_of_range (result" },
		{ { .param = "spd", .result = DB_RESULT_TIMEOUT },
		  "a write of parameter spd is not confirmed: timeout" },
		{ { .result = DB_RESULT_INDETERMINATE },
		  "a write is not confirmed: indeterminate" },
	};

	(void)state;
	service_registers_ops.tripped(&bench.service, bus, drive, &client);
	expect_next("log watchdog-tripped a/d/192.168.0.7: it was silent for too long");
	service_registers_ops.tripped(&bench.service, bus, drive, &(struct db_client){ .id = 0 });
	expect_next("log watchdog-tripped a/d/-: it was silent for too long");
	for (size_t i = 0; i < sizeof(refusals) / sizeof(refusals[0]); i++) {
		const struct db_client *who = i == 0 ? NULL : &client;

		service_registers_ops.write_refused(&bench.service, bus, drive, who,
		                                    &refusals[i].write);
		expect_next(who ? "log command-refused a/d/192.168.0.7: " :
		                  "log command-refused a/d/-: ");
		expect_next(refusals[i].line);
	}
}

/* --- alone ------------------------------------------------------------------------------------ */

static void a_configuration_is_run_once(void **state)
{
	pid_t holder = -1;
	int lock = alone_take(bench.path, &holder);
	char again[512];

	(void)state;
	assert_true(lock >= 0);
	assert_int_equal(alone_take(bench.path, &holder), -EBUSY);
	assert_int_equal(holder, getpid());
	/* The same file by another name. */
	snprintf(again, sizeof(again), "/tmp/.%s", bench.path + strlen("/tmp"));
	assert_int_equal(alone_take(again, &holder), -EBUSY);
	close(lock);
	lock = alone_take(again, &holder);
	assert_true(lock >= 0);
	close(lock);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(a_hung_thread_is_found_within_half_of_the_patience,
		                                begin, end),
		cmocka_unit_test_setup_teardown(a_bus_that_has_ended_does_not_hang, begin, end),
		cmocka_unit_test_setup_teardown(a_bus_that_never_turned_has_its_time_too, begin,
		                                end),
		cmocka_unit_test_setup_teardown(completions_are_fetched_when_a_bus_rings, begin,
		                                end),
		cmocka_unit_test_setup_teardown(sigterm_ends_the_loop, begin, end),
		cmocka_unit_test_setup_teardown(sigint_ends_the_loop, begin, end),
		cmocka_unit_test_setup_teardown(without_systemd_nobody_feeds_its_watchdog, begin,
		                                end),
		cmocka_unit_test_setup_teardown(buses_and_reloads_find_descriptors, begin, end),
		cmocka_unit_test_setup_teardown(the_address_that_is_listened_on_is_logged, begin,
		                                end),
		cmocka_unit_test_setup_teardown(watchdogs_and_refusals_name_bus_drive_and_client,
		                                begin, end),
		cmocka_unit_test_setup_teardown(a_configuration_is_run_once, begin, end),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
