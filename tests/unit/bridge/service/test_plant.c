/* SPDX-License-Identifier: Apache-2.0 */
/* Which buses and drives a plant for another file shares with the one that runs. */
#include "config/config_private.h"
#include "fakes.h"

#define BUS(name) \
	"bus " name " { protocol = vsmd-serial baud = 115200 device = \"/dev/" name "\" }\n"
#define DRIVE(name, bus, number) \
	"drive " name " { bus = " bus " address = " number " unit = " number " }\n"
#define BOTH BUS("a") BUS("b") DRIVE("d", "a", "1") DRIVE("e", "a", "2") DRIVE("f", "b", "3")

static struct service service;
static uint16_t last_number;

static struct plant *make_plant(const char *text, const struct plant *running)
{
	struct db_config *config = NULL;
	struct plant *plant = NULL;

	assert_int_equal(db_load_text(&db_load_built_in, text, "f", stderr, &config), 0);
	assert_int_equal(plant_new(&service, config, running, &last_number, &plant), 0);
	return plant;
}

static int clear(void **state)
{
	(void)state;
	memset(&fake, 0, sizeof(fake));
	clear_journal();
	last_number = 0;
	return 0;
}

static const struct plant_bus *bus_of(const struct plant *plant, const char *name)
{
	const struct plant_bus *bus = plant_bus_named(plant, name);

	assert_non_null(bus);
	return bus;
}

static const struct plant_drive *drive_of(const struct plant *plant, const char *name)
{
	const struct plant_drive *drive = plant_drive_named(plant, name);

	assert_non_null(drive);
	return drive;
}

static void the_first_plant_has_all_of_its_file(void **state)
{
	struct plant *plant = make_plant(BOTH, NULL);

	(void)state;
	assert_int_equal(plant->bus_count, 2);
	assert_int_equal(plant->drive_count, 3);
	assert_ptr_equal(drive_of(plant, "e")->bus, bus_of(plant, "a"));
	assert_ptr_equal(drive_of(plant, "f")->bus, bus_of(plant, "b"));
	assert_null(plant_bus_named(plant, "c"));
	assert_null(plant_drive_named(plant, "c"));
	expect_next("make bus a of 2");
	expect_next("make bus b of 1");
	expect_never("start");
	plant_free(plant, NULL);
	expect_next("free a");
	expect_next("free b");
}

static void the_same_file_shares_everything(void **state)
{
	struct plant *running = make_plant(BOTH, NULL);
	/* In another order, and with presets written out. */
	struct plant *next = make_plant(
		BUS("a") BUS("b") DRIVE("d", "a", "1")
			DRIVE("e", "a",
	                      "2") "drive f { unit = 3 bus = b address = 3 watchdog-ms = 3000 }\n",
		running);

	(void)state;
	assert_true(plant_same(running, next));
	assert_true(plant_same(next, running));
	assert_ptr_equal(bus_of(running, "a"), bus_of(next, "a"));
	assert_ptr_equal(drive_of(running, "f"), drive_of(next, "f"));
	/* Its sections are those that it was made from. */
	assert_ptr_equal(drive_of(next, "f")->edition, running->edition);
	plant_free(running, next);
	expect_never("free");
	plant_free(next, NULL);
	expect_next("free a");
}

static void a_changed_drive_is_another_one_on_the_same_bus(void **state)
{
	struct plant *running = make_plant(BOTH, NULL);
	struct plant *next = make_plant(BUS("a") BUS("b") DRIVE("d", "a", "1") DRIVE("e", "a", "9")
	                                        DRIVE("f", "b", "3"),
	                                running);
	struct db_bus_drive *leaving, *coming;
	size_t leaving_count, coming_count;

	(void)state;
	assert_false(plant_same(running, next));
	assert_ptr_equal(bus_of(running, "a"), bus_of(next, "a"));
	assert_ptr_equal(drive_of(running, "d"), drive_of(next, "d"));
	assert_ptr_not_equal(drive_of(running, "e"), drive_of(next, "e"));
	assert_int_not_equal(drive_of(running, "e")->number, drive_of(next, "e")->number);

	leaving = plant_drives_on(running, bus_of(running, "a"), next, &leaving_count);
	coming = plant_drives_on(next, bus_of(next, "a"), running, &coming_count);
	assert_int_equal(leaving_count, 1);
	assert_int_equal(leaving[0].drive, drive_of(running, "e")->number);
	assert_int_equal(coming_count, 1);
	assert_int_equal(coming[0].config->address, 9);
	assert_ptr_equal(coming[0].axis, drive_of(next, "e")->axis);
	free(leaving);
	free(coming);
	plant_free(running, next);
	expect_never("free");
	plant_free(next, NULL);
}

static void a_changed_bus_takes_its_drives_along(void **state)
{
	struct plant *running = make_plant(BOTH, NULL);
	struct plant *next = make_plant(
		"bus a { protocol = vsmd-serial baud = 115200 device = \"/dev/x\" }\n" BUS("b")
			DRIVE("d", "a", "1") DRIVE("e", "a", "2") DRIVE("f", "b", "3"),
		running);

	(void)state;
	assert_ptr_not_equal(bus_of(running, "a"), bus_of(next, "a"));
	assert_ptr_equal(bus_of(running, "b"), bus_of(next, "b"));
	assert_ptr_not_equal(drive_of(running, "d"), drive_of(next, "d"));
	assert_ptr_equal(drive_of(running, "f"), drive_of(next, "f"));
	plant_free(running, next);
	expect_next("free a");
	expect_never("free b");
	plant_free(next, NULL);
}

/* Forgetting what a reload prepared leaves what runs. */
static void a_plant_that_is_not_taken_leaves_no_trace(void **state)
{
	struct plant *running = make_plant(BOTH, NULL);
	struct plant *next = make_plant(BUS("a") BUS("c") DRIVE("g", "c", "3"), running);

	(void)state;
	plant_free(next, running);
	expect_next("free c");
	expect_never("free a");
	assert_int_equal(running->edition->users, 1 + 2 + 3);
	plant_free(running, NULL);
}

static void numbers_are_never_shared_and_never_the_last(void **state)
{
	struct plant *running, *next;

	(void)state;
	last_number = 65532;
	running = make_plant(BOTH, NULL);
	/* Numbers are below 65535. */
	assert_int_equal(drive_of(running, "d")->number, 65533);
	assert_int_equal(drive_of(running, "e")->number, 65534);
	assert_int_equal(drive_of(running, "f")->number, 0);
	last_number = 65532;
	next = make_plant(BUS("a") BUS("b") DRIVE("g", "b", "7"), running);
	assert_int_equal(drive_of(next, "g")->number, 1);
	plant_free(running, next);
	plant_free(next, NULL);
}

static void the_roster_is_in_the_order_of_the_file(void **state)
{
	struct plant *running = make_plant(BOTH, NULL);
	struct plant *next = make_plant(BUS("b") BUS("a") DRIVE("f", "b", "3") DRIVE("d", "a", "1"),
	                                running);
	struct plant_roster roster;

	(void)state;
	assert_int_equal(plant_roster_init(&roster, next), 0);
	assert_int_equal(roster.roster.bus_count, 2);
	assert_string_equal(roster.roster.buses[0].config->name, "b");
	assert_ptr_equal(roster.roster.buses[1].bus, bus_of(running, "a")->bus);
	assert_int_equal(roster.roster.drive_count, 2);
	assert_string_equal(roster.roster.drives[0].config->name, "f");
	assert_int_equal(roster.roster.drives[0].bus, 0);
	assert_int_equal(roster.roster.drives[1].bus, 1);
	assert_int_equal(roster.roster.drives[1].drive, drive_of(running, "d")->number);
	assert_ptr_equal(roster.roster.modbus, &next->edition->config->modbus);
	plant_roster_release(&roster);
	assert_false(plant_same(running, next));
	plant_free(running, next);
	plant_free(next, NULL);
}

static void buses_end_side_by_side(void **state)
{
	struct plant *plant = make_plant(BOTH, NULL);

	(void)state;
	clear_journal();
	plant_end(plant);
	expect_next("ask end of a");
	expect_next("ask end of b");
	for (size_t i = 0; i < plant->bus_count; i++)
		assert_true(db_bus_has_ended(plant->buses[i]->bus));
	/* The drives are still there for the tools that show them, and the requests at the buses
	 * for the registers. */
	assert_non_null(drive_of(plant, "d")->axis);
	plant_free(plant, NULL);
	expect_next("free a");
	expect_next("free b");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(the_first_plant_has_all_of_its_file, clear),
		cmocka_unit_test_setup(the_same_file_shares_everything, clear),
		cmocka_unit_test_setup(a_changed_drive_is_another_one_on_the_same_bus, clear),
		cmocka_unit_test_setup(a_changed_bus_takes_its_drives_along, clear),
		cmocka_unit_test_setup(a_plant_that_is_not_taken_leaves_no_trace, clear),
		cmocka_unit_test_setup(numbers_are_never_shared_and_never_the_last, clear),
		cmocka_unit_test_setup(the_roster_is_in_the_order_of_the_file, clear),
		cmocka_unit_test_setup(buses_end_side_by_side, clear),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
