/* SPDX-License-Identifier: Apache-2.0 */
/* The two halves of a reload, with buses that end when the test says so. */
#include "bench.h"

#include <errno.h>

#define BUS(name) \
	"bus " name " { protocol = vsmd-serial baud = 115200 device = \"/dev/" name "\" }\n"
#define DRIVE(name, bus, number) \
	"drive " name " { bus = " bus " address = " number " unit = " number " }\n"

#define BEFORE \
	BUS("a") BUS("b") DRIVE("kept", "a", "1") DRIVE("gone", "a", "2") DRIVE("moved", "b", "3")
#define AFTER \
	BUS("a") BUS("c") DRIVE("kept", "a", "1") DRIVE("new", "a", "4") DRIVE("moved", "c", "3")

#define GATEWAY_PATH_UNAVAILABLE 0x0A

static struct bench bench;

static uint8_t answer_of(uint8_t unit)
{
	static const struct db_client client = { .id = 1 };

	return db_registers_backend.unit(bench.service.registers, &client, unit);
}

static struct db_bus *bus_named(const char *name)
{
	return plant_bus_named(bench.service.plant, name)->bus;
}

/* One step that nothing comes of yet. */
static void expect_waiting(void)
{
	const struct plant *running = bench.service.plant;

	reload_step(&bench.service);
	assert_non_null(bench.service.reload);
	assert_ptr_equal(bench.service.plant, running);
}

static void what_stays_goes_on_and_the_rest_takes_turns(void **state)
{
	const struct plant_bus *kept_bus;
	const struct plant_drive *kept;
	struct db_bus *a;

	(void)state;
	begin_service(&bench, BEFORE);
	kept_bus = plant_bus_named(bench.service.plant, "a");
	kept = plant_drive_named(bench.service.plant, "kept");
	a = bus_named("a");
	write_file(&bench, AFTER);
	reload_ask(&bench.service);

	/* The first half: what comes is made, what goes is told, and only then does anybody
	 * hear. */
	expect_next("make bus c of 1");
	expect_next("log reload b/-/-: reload: it is removed");
	expect_next("log reload c/-/-: reload: it is added");
	expect_next("log reload a/gone/-: reload: it is removed: its on-exit is carried out");
	expect_next("log reload b/moved/-: reload: it is changed: its on-exit is carried out");
	expect_next("log reload a/new/-: reload: it is added");
	expect_next("reload: 1 drive continues without interruption");
	expect_next("server takes 127.0.0.1:502");
	expect_next("change a: 1 leave, 1 come");
	expect_next("ask end of b");
	expect_never("ask end of a");
	assert_int_equal(answer_of(1), 0);
	assert_int_equal(answer_of(2), GATEWAY_PATH_UNAVAILABLE);
	assert_int_equal(answer_of(3), GATEWAY_PATH_UNAVAILABLE);
	assert_int_equal(answer_of(4), GATEWAY_PATH_UNAVAILABLE);

	/* Between the halves: everything that leaves has to be gone. */
	expect_waiting();
	a->carried_out = true;
	a->completed = true;
	expect_waiting();
	expect_next("fetched of a");
	bus_named("b")->completed = true;
	expect_waiting();
	expect_never("start c");
	expect_never(": reload: done");
	bus_named("b")->ended = true;

	/* The second half: its last completions, and then what comes. */
	reload_step(&bench.service);
	expect_next("fetched of b");
	expect_next("start c");
	expect_next("free b");
	expect_next("reload: done");
	expect_never("start a");
	expect_never("free a");
	assert_null(bench.service.reload);
	assert_ptr_equal(plant_bus_named(bench.service.plant, "a"), kept_bus);
	assert_ptr_equal(plant_drive_named(bench.service.plant, "kept"), kept);
	for (uint8_t unit = 1; unit <= 4; unit++)
		assert_int_equal(answer_of(unit), unit == 2 ? GATEWAY_PATH_UNAVAILABLE : 0);
	assert_int_equal(fake.descriptors_kept, 24 + DB_CONTROL_SOCKET_DESCRIPTORS + 8 * 2);
	end_service(&bench);
}

static void a_file_that_says_the_same_changes_nothing(void **state)
{
	const struct plant *running;

	(void)state;
	begin_service(&bench, BEFORE);
	running = bench.service.plant;
	write_file(&bench, "# a comment\n" BEFORE "end\n");
	reload_ask(&bench.service);
	expect_next("is what is loaded already; nothing changes");
	expect_never("make bus");
	expect_never("server");
	assert_null(bench.service.reload);
	assert_ptr_equal(bench.service.plant, running);
	/* But it ends with `end` from now on: without it, it is cut off. */
	clear_journal();
	write_file(&bench, BEFORE);
	reload_ask(&bench.service);
	expect_next("log config-wrong -/-/-: /tmp/");
	expect_next("its last line was end and is not any more");
	assert_ptr_equal(bench.service.plant, running);
	end_service(&bench);
}

static void a_wrong_file_changes_nothing(void **state)
{
	static const char *const wrong[] = {
		"bus a { protocol = nothing }\n", /* an error */
		"bus a {\n",                      /* no form */
		"",                               /* cut off */
	};

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		const struct plant *running;

		begin_service(&bench, BEFORE);
		running = bench.service.plant;
		write_file(&bench, wrong[i]);
		reload_ask(&bench.service);
		expect_next("log config-wrong");
		expect_next("has an error and is not loaded");
		expect_never("make bus");
		assert_null(bench.service.reload);
		assert_ptr_equal(bench.service.plant, running);
		end_service(&bench);
	}
}

static void an_address_that_cannot_be_had_changes_nothing(void **state)
{
	const struct plant *running;

	(void)state;
	begin_service(&bench, BEFORE);
	running = bench.service.plant;
	fake.prepare_error = -EADDRINUSE;
	write_file(&bench, "modbus { listen = \"127.0.0.1:1503\" }\n" AFTER);
	reload_ask(&bench.service);
	expect_next("log reload-failed -/-/-: reload: cannot listen on 127.0.0.1:1503");
	expect_never("change a");
	expect_never("ask end");
	assert_null(bench.service.reload);
	assert_ptr_equal(bench.service.plant, running);
	for (uint8_t unit = 1; unit <= 3; unit++)
		assert_int_equal(answer_of(unit), 0);
	/* And the next one finds nothing left over. */
	fake.prepare_error = 0;
	reload_ask(&bench.service);
	expect_next("change a: 1 leave, 1 come");
	end_service(&bench);
}

static void only_the_network_side_changes_at_once(void **state)
{
	(void)state;
	begin_service(&bench, BEFORE);
	write_file(&bench, "modbus { listen = \"127.0.0.1:1503\" log = error }\n" BEFORE);
	reload_ask(&bench.service);
	expect_next("the section modbus is changed");
	expect_next("reload: 3 drives continue without interruption");
	expect_next("server takes 127.0.0.1:1503");
	expect_next("listening on 127.0.0.1:1502");
	assert_int_equal(bench.service.log.level, DB_LOG_ERROR);
	reload_step(&bench.service);
	expect_next("reload: done");
	assert_null(bench.service.reload);
	end_service(&bench);
}

static void a_reload_during_a_reload_comes_after_it(void **state)
{
	(void)state;
	begin_service(&bench, BEFORE);
	write_file(&bench, AFTER);
	reload_ask(&bench.service);
	write_file(&bench, BUS("a") BUS("c") DRIVE("moved", "c", "3"));
	reload_ask(&bench.service);
	reload_ask(&bench.service);
	expect_waiting();
	bus_named("a")->carried_out = true;
	bus_named("b")->ended = true;
	reload_step(&bench.service);
	expect_next("reload: done");
	/* Both asked for the same: the file is read once more, as it is now. */
	expect_next("log reload a/kept/-: reload: it is removed");
	expect_next("change a: 2 leave, 0 come");
	assert_non_null(bench.service.reload);
	assert_false(bench.service.reload_again);
	expect_waiting();
	bus_named("a")->carried_out = true;
	reload_step(&bench.service);
	expect_next("reload: done");
	assert_null(bench.service.reload);
	end_service(&bench);
}

static void half_a_plant_ends_the_service(void **state)
{
	int code = 0;

	(void)state;
	begin_service(&bench, BEFORE);
	write_file(&bench, AFTER);
	reload_ask(&bench.service);
	bus_named("a")->carried_out = true;
	bus_named("b")->ended = true;
	fake.start_error = -EAGAIN;
	reload_step(&bench.service);
	assert_int_equal(sd_event_get_exit_code(bench.service.loop, &code), 0);
	assert_int_equal(code, -EAGAIN);
	expect_never("reload: done");
	end_service(&bench);
}

static void an_end_in_between_frees_both_plants(void **state)
{
	(void)state;
	begin_service(&bench, BEFORE);
	write_file(&bench, AFTER);
	reload_ask(&bench.service);
	expect_waiting();
	end_service(&bench);
	for (const char *name = "abc"; *name; name++) {
		char line[] = "free ?";

		line[5] = *name;
		assert_non_null(strstr(fake.journal, line));
	}
	assert_null(bench.service.reload);
}

/* The ring of a bus wakes the loop, whose turn goes on with the reload. */
static void the_loop_carries_it_out(void **state)
{
	(void)state;
	begin_service(&bench, BEFORE);
	write_file(&bench, AFTER);
	assert_int_equal(raise(SIGHUP), 0);
	assert_true(sd_event_run(bench.service.loop, UINT64_MAX) > 0);
	expect_next("ask end of b");
	bus_named("a")->carried_out = true;
	bus_named("b")->ended = true;
	assert_int_equal(eventfd_write(bus_named("b")->fd, 1), 0);
	assert_true(sd_event_run(bench.service.loop, UINT64_MAX) > 0);
	expect_next("start c");
	expect_next("reload: done");
	assert_int_equal(raise(SIGTERM), 0);
	assert_int_equal(sd_event_loop(bench.service.loop), 0);
	end_service(&bench);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_stays_goes_on_and_the_rest_takes_turns),
		cmocka_unit_test(a_file_that_says_the_same_changes_nothing),
		cmocka_unit_test(a_wrong_file_changes_nothing),
		cmocka_unit_test(an_address_that_cannot_be_had_changes_nothing),
		cmocka_unit_test(only_the_network_side_changes_at_once),
		cmocka_unit_test(a_reload_during_a_reload_comes_after_it),
		cmocka_unit_test(half_a_plant_ends_the_service),
		cmocka_unit_test(an_end_in_between_frees_both_plants),
		cmocka_unit_test(the_loop_carries_it_out),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
