/* SPDX-License-Identifier: Apache-2.0 */
/* Probes of drives that are offline: when they are sent, and what they may take of the wire. */
#include "fakes/bus.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define DRIVES 6
#define MS DB_NS_PER_MS

/* Only the first drive answers. */
static struct fake_bus *open_with_dead_drives(void)
{
	struct fake_bus *bus = fake_bus_new(&fake_family, DRIVES);

	bus->config.retries = 2;
	bus->config.drive_latency_ms = 40;
	for (unsigned address = 2; address <= DRIVES; address++)
		bus->dead[address] = true;
	fake_bus_open(bus, DRIVES, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 500 * MS);
	assert_true(fake_is_online(bus, 0));
	return bus;
}

/* Closes and opens the port, and lets the first drive miss this number of probes. Returns how long it is offline. */
static db_time reopen_port(struct fake_bus *bus, unsigned missed)
{
	db_time opened;

	fake_port(bus, 5);
	fake_pass(bus, 100 * MS);
	fake_forget_sent(bus);
	bus->dead[1] = missed > 0;
	opened = bus->now;
	fake_port(bus, 0);
	while (!fake_is_online(bus, 0) && bus->now - opened < 20 * DB_NS_PER_S) {
		bus->dead[1] = fake_count(bus, 1, FAKE_PROBE) < missed;
		fake_pass(bus, MS / 2);
		if (fake_count(bus, 1, FAKE_PROBE) >= missed)
			bus->dead[1] = false;
	}
	return bus->now - opened;
}

/* A probe and the time in which it is not answered. */
static db_time unanswered(const struct fake_bus *bus)
{
	return FAKE_WIRE_TIME + (db_time)bus->config.drive_latency_ms * MS;
}

static void a_drive_that_answered_before_the_port_was_lost_is_not_put_off_by_one_loss(void **state)
{
	struct fake_bus *bus = open_with_dead_drives();
	/* Each of the others is probed once, and a probe is repeated after 100 ms. */
	db_time first_round = DRIVES * unanswered(bus);

	(void)state;
	assert_true(reopen_port(bus, 0) < first_round);
	assert_true(reopen_port(bus, 1) < first_round + 150 * MS);
	assert_true(reopen_port(bus, 2) < first_round + 350 * MS);
	/* After that it counts as one of those that are gone. */
	assert_true(reopen_port(bus, 3) > first_round + 2000 * MS);
	fake_bus_free(bus);
}

static void drives_that_never_answered_are_probed_once_and_then_cost_a_twentieth(void **state)
{
	struct fake_bus *bus = open_with_dead_drives();
	unsigned probes = 0;

	(void)state;
	(void)reopen_port(bus, 0);
	fake_pass(bus, DRIVES * unanswered(bus));
	for (unsigned address = 2; address <= DRIVES; address++) {
		assert_in_range(fake_count(bus, address, FAKE_PROBE), 1, 2);
		probes += fake_count(bus, address, FAKE_PROBE);
	}
	/* One of them may have its turn again by then. */
	assert_in_range(probes, DRIVES - 1, DRIVES);
	probes = 0;
	fake_forget_sent(bus);
	fake_pass(bus, 10 * DB_NS_PER_S);
	for (unsigned address = 2; address <= DRIVES; address++)
		probes += fake_count(bus, address, FAKE_PROBE);
	assert_in_range(probes, 1, 10 * DB_NS_PER_S / 20 / unanswered(bus) + 1);
	fake_bus_free(bus);
}

/* Nothing was lost to the others by that: the port took nothing from anybody. */
static void a_port_that_was_full_for_long_puts_off_no_probe(void **state)
{
	struct fake_bus *bus = open_with_dead_drives();

	(void)state;
	bus->dead[1] = true;
	fake_pass(bus, 5 * DB_NS_PER_S);
	assert_false(fake_is_online(bus, 0));
	fake_forget_sent(bus);
	while (fake_count(bus, 1, FAKE_PROBE) == 0)
		fake_pass(bus, MS / 2);
	db_engine_hold(bus->engine, true, bus->now);
	fake_pass(bus, 5 * DB_NS_PER_S);
	db_engine_hold(bus->engine, false, bus->now);
	bus->dead[1] = false;
	fake_pass(bus, 2 * DRIVES * 20 * unanswered(bus));
	assert_true(fake_is_online(bus, 0));
	fake_bus_free(bus);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(
			a_drive_that_answered_before_the_port_was_lost_is_not_put_off_by_one_loss),
		cmocka_unit_test(
			drives_that_never_answered_are_probed_once_and_then_cost_a_twentieth),
		cmocka_unit_test(a_port_that_was_full_for_long_puts_off_no_probe),
	};

	return cmocka_run_group_tests_name("probes", tests, NULL, NULL);
}
