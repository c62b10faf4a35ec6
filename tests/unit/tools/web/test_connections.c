/* SPDX-License-Identifier: Apache-2.0 */
#include "web/connections.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MOST 8U
#define MOST_STRANGERS 6U
#define MOST_PER_ADDRESS 4U

static struct db_web_address address_of(unsigned char last)
{
	return (struct db_web_address){
		.bytes = { [10] = 0xFF, [11] = 0xFF, [12] = 10, [15] = last }
	};
}

/* One of this address comes; `leaver`: who had to go for it. */
static struct db_web_connection *come(struct db_web_connections *connections, unsigned char last,
                                      struct db_web_connection **leaver)
{
	struct db_web_address address = address_of(last);
	struct db_web_connection *connection;

	if (!db_web_connections_admit(connections, &address, true, 0, leaver))
		return NULL;
	connection = db_web_connections_add(connections, &address, true, NULL);
	assert_non_null(connection);
	return connection;
}

static struct db_web_connection *come_alone(struct db_web_connections *connections,
                                            unsigned char last)
{
	struct db_web_connection *leaver;
	struct db_web_connection *connection = come(connections, last, &leaver);

	assert_non_null(connection);
	assert_null(leaver);
	return connection;
}

static void hear(struct db_web_connection *connection, bool known, bool busy, bool waits)
{
	connection->heard = true;
	connection->known = known;
	connection->busy = busy;
	connection->waits = waits;
}

static void test_the_oldest_of_the_busiest_goes(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST_PER_ADDRESS, 7);
	struct db_web_connection *first[3];
	struct db_web_connection *leaver;

	(void)state;
	come_alone(connections, 1);
	for (size_t i = 0; i < 3; i++)
		first[i] = come_alone(connections, 2);
	for (size_t i = 0; i < MOST_STRANGERS - 4; i++)
		come_alone(connections, (unsigned char)(3 + i));
	assert_non_null(come(connections, 9, &leaver));
	assert_ptr_equal(leaver, first[0]);
	/* It counts no more, though it is still to be closed. */
	assert_int_equal(db_web_connections_count(connections), MOST_STRANGERS + 1);
	assert_non_null(come(connections, 9, &leaver));
	assert_ptr_equal(leaver, first[1]);
	db_web_connections_remove(connections, first[0]);
	db_web_connections_remove(connections, first[1]);
	assert_int_equal(db_web_connections_count(connections), MOST_STRANGERS);
	free(connections);
}

static void test_places_are_kept_for_who_is_logged_in(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST_PER_ADDRESS, 7);
	struct db_web_connection *known[MOST - MOST_STRANGERS];
	struct db_web_connection *leaver;

	(void)state;
	for (size_t i = 0; i < MOST - MOST_STRANGERS; i++) {
		known[i] = come_alone(connections, 1);
		hear(known[i], true, false, false);
	}
	for (size_t i = 0; i < MOST_STRANGERS; i++)
		hear(come_alone(connections, (unsigned char)(10 + i)), false, true, true);
	/* Whatever comes on top of them, and whatever it has got so far, takes no place of theirs. */
	for (size_t i = 0; i < 5 * MOST; i++) {
		struct db_web_connection *next = come(connections, (unsigned char)(20 + i),
		                                      &leaver);

		assert_non_null(next);
		assert_non_null(leaver);
		for (size_t k = 0; k < MOST - MOST_STRANGERS; k++)
			assert_ptr_not_equal(leaver, known[k]);
		db_web_connections_remove(connections, leaver);
		hear(next, false, i % 2, i % 2);
	}
	free(connections);
}

static void test_who_has_one_does_not_go_for_who_has_many(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST, 7);
	struct db_web_connection *leaver;
	struct db_web_connection *one;

	(void)state;
	for (size_t i = 0; i < MOST_STRANGERS - 1; i++)
		hear(come_alone(connections, 2), false, true, true);
	/* It has not yet got as far as all others have. */
	one = come_alone(connections, 1);
	for (size_t i = 0; i < 3 * MOST; i++) {
		struct db_web_connection *next = come(connections, 2, &leaver);

		assert_non_null(next);
		assert_non_null(leaver);
		assert_ptr_not_equal(leaver, one);
		db_web_connections_remove(connections, leaver);
		hear(next, false, true, true);
	}
	free(connections);
}

static void test_an_address_that_is_logged_in_goes_last(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST, 7);
	struct db_web_connection *leaver;
	struct db_web_connection *own;

	(void)state;
	hear(come_alone(connections, 1), true, false, false);
	own = come_alone(connections, 1);
	/* Each from another address, and each is younger. */
	for (size_t i = 0; i < 5 * MOST; i++) {
		assert_non_null(come(connections, (unsigned char)(2 + i), &leaver));
		assert_ptr_not_equal(leaver, own);
		if (leaver)
			db_web_connections_remove(connections, leaver);
	}
	free(connections);
}

static void test_a_network_of_ipv6_is_one_address(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST_PER_ADDRESS, 7);
	struct db_web_connection *first = NULL;
	struct db_web_connection *leaver;

	(void)state;
	for (unsigned char i = 0; i <= MOST_PER_ADDRESS; i++) {
		struct db_web_address address = { { 0xFD, [7] = 9, [8] = i, [15] = i } };

		assert_true(db_web_connections_admit(connections, &address, true, 0, &leaver));
		assert_ptr_equal(leaver, i < MOST_PER_ADDRESS ? NULL : first);
		leaver = db_web_connections_add(connections, &address, true, NULL);
		first = first ? first : leaver;
	}
	free(connections);
}

static void test_who_opens_one_after_another_waits(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST, 7);
	struct db_web_address address = address_of(1);
	struct db_web_address other = address_of(2);
	struct db_web_connection *leaver;
	db_time now = 5 * DB_NS_PER_S;

	(void)state;
	for (unsigned i = 0; i < DB_WEB_CONNECTIONS_AT_ONCE; i++)
		assert_true(db_web_connections_admit(connections, &address, true, now, &leaver));
	assert_false(db_web_connections_admit(connections, &address, true, now, &leaver));
	assert_true(db_web_connections_admit(connections, &other, true, now, &leaver));
	/* What comes through a proxy may come. */
	assert_true(db_web_connections_admit(connections, &address, false, now, &leaver));
	now += DB_WEB_CONNECTION_EVERY;
	assert_true(db_web_connections_admit(connections, &address, true, now, &leaver));
	assert_false(db_web_connections_admit(connections, &address, true, now, &leaver));
	free(connections);
}

static unsigned closed;

static void count_closed(void *handle)
{
	(void)handle;
	closed++;
}

static void test_who_sends_no_head_is_closed(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST, 7);
	struct db_web_connection *heard = come_alone(connections, 1);

	(void)state;
	hear(heard, false, false, false);
	come_alone(connections, 2);
	closed = 0;
	for (unsigned tick = 0; tick < 100; tick++)
		db_web_connections_tick(connections, count_closed);
	assert_int_equal(closed, 0);
	db_web_connections_tick(connections, count_closed);
	assert_int_equal(closed, 1);
	/* Earlier when places run short. */
	for (size_t i = 0; i < MOST_STRANGERS - 1; i++)
		come_alone(connections, 3);
	for (unsigned tick = 0; tick < 20; tick++)
		db_web_connections_tick(connections, count_closed);
	assert_int_equal(closed, 1);
	db_web_connections_tick(connections, count_closed);
	assert_int_equal(closed, MOST_STRANGERS);
	/* Nor does a body take longer, whoever sends it. */
	closed = 0;
	hear(heard, true, true, false);
	heard->receives = true;
	for (unsigned tick = 0; tick < 100; tick++)
		db_web_connections_tick(connections, count_closed);
	assert_int_equal(closed, 0);
	db_web_connections_tick(connections, count_closed);
	assert_int_equal(closed, 1);
	free(connections);
}

static void test_an_address_that_has_many_gives_way_to_itself(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST_PER_ADDRESS, 7);
	struct db_web_connection *leaver;
	struct db_web_connection *first = come_alone(connections, 1);
	struct db_web_connection *own;
	struct db_web_address address = address_of(1);

	(void)state;
	for (unsigned i = 1; i < MOST_PER_ADDRESS; i++)
		come_alone(connections, 1);
	own = come(connections, 1, &leaver);
	assert_non_null(own);
	assert_ptr_equal(leaver, first);
	/* What a proxy brings is not counted. */
	assert_true(db_web_connections_admit(connections, &address, false, 0, &leaver));
	assert_null(leaver);
	free(connections);
}

static void test_who_asks_stays(void **state)
{
	struct db_web_connections *connections = db_web_connections_new(MOST, MOST, 7);
	struct db_web_connection *all[MOST];
	struct db_web_connection *leaver;

	(void)state;
	for (size_t i = 0; i < MOST; i++) {
		all[i] = come_alone(connections, 1);
		hear(all[i], true, true, true);
	}
	/* All have something under way. */
	assert_null(come(connections, 2, &leaver));
	assert_null(leaver);
	/* From the one that goes last to the one that goes first. */
	hear(all[3], true, false, false);
	hear(all[4], false, true, true);
	hear(all[5], false, false, false);
	hear(all[6], false, true, false);
	all[7]->heard = false;
	for (size_t i = MOST; i-- > 3;) {
		struct db_web_connection *next = come(connections, 2, &leaver);

		assert_non_null(next);
		/* Of strangers the older one first, however far it has come. */
		assert_ptr_equal(leaver, i == 6 ? all[5] : i == 5 ? all[6] : all[i]);
		hear(next, true, true, true);
	}
	assert_null(come(connections, 2, &leaver));
	free(connections);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_the_oldest_of_the_busiest_goes),
		cmocka_unit_test(test_places_are_kept_for_who_is_logged_in),
		cmocka_unit_test(test_who_has_one_does_not_go_for_who_has_many),
		cmocka_unit_test(test_an_address_that_is_logged_in_goes_last),
		cmocka_unit_test(test_a_network_of_ipv6_is_one_address),
		cmocka_unit_test(test_who_opens_one_after_another_waits),
		cmocka_unit_test(test_who_sends_no_head_is_closed),
		cmocka_unit_test(test_an_address_that_has_many_gives_way_to_itself),
		cmocka_unit_test(test_who_asks_stays),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
