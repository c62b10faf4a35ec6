/* SPDX-License-Identifier: Apache-2.0 */
#include "identity/certificates.h"

#include <stdlib.h>
#include <string.h>

/* More than there can be clients. */
#define PLACES_MAX 1280
#define PLACES_FIRST 8

struct place {
	uint32_t number; /* 0: it is free */
	unsigned connections;
	uint64_t left; /* order of leaving, when there are no connections */
	uint8_t fingerprint[DB_SECURE_FINGERPRINT_SIZE];
	char name[DB_SECURE_NAME_MAX + 1];
	char role[DB_SECURE_ROLE_MAX + 1];
};

struct db_certificates {
	uint64_t leavings;
	struct place *places;
	size_t used; /* places from here on were never used */
	size_t room;
};

struct db_certificates *db_certificates_new(void)
{
	return calloc(1, sizeof(struct db_certificates));
}

void db_certificates_free(struct db_certificates *certificates)
{
	if (certificates)
		free(certificates->places);
	free(certificates);
}

static struct place *find(struct db_certificates *certificates, uint32_t number)
{
	for (size_t i = 0; number != 0 && i < certificates->used; i++) {
		if (certificates->places[i].number == number)
			return &certificates->places[i];
	}
	return NULL;
}

/* A new place, or that of the certificate without connections for longest; null: there is none. */
static struct place *find_room(struct db_certificates *certificates)
{
	struct place *chosen = NULL;
	size_t room = certificates->room == 0 ? PLACES_FIRST : 2 * certificates->room;
	struct place *grown;

	if (certificates->used == certificates->room && room <= PLACES_MAX) {
		grown = realloc(certificates->places, room * sizeof(*grown));
		if (grown) {
			certificates->places = grown;
			certificates->room = room;
		}
	}
	if (certificates->used < certificates->room)
		return &certificates->places[certificates->used++];
	for (size_t i = 0; i < certificates->used; i++) {
		struct place *place = &certificates->places[i];

		if (place->connections == 0 && (!chosen || place->left < chosen->left))
			chosen = place;
	}
	return chosen;
}

bool db_certificates_hold(struct db_certificates *certificates,
                          const struct db_secure_client *client, uint8_t address[16])
{
	struct place *place = NULL;

	for (size_t i = 0; i < certificates->used && !place; i++) {
		if (memcmp(certificates->places[i].fingerprint, client->fingerprint,
		           sizeof(client->fingerprint)) == 0)
			place = &certificates->places[i];
	}
	if (!place) {
		uint32_t number;

		place = find_room(certificates);
		if (!place)
			return false;
		*place = (struct place){ .number = 0 };
		/* The first number from the fingerprint's first bytes on that no other certificate
		 * has. */
		number = (uint32_t)client->fingerprint[0] << 24 |
		         (uint32_t)client->fingerprint[1] << 16 |
		         (uint32_t)client->fingerprint[2] << 8 | client->fingerprint[3];
		while (number == 0 || find(certificates, number))
			number++;
		place->number = number;
		memcpy(place->fingerprint, client->fingerprint, sizeof(place->fingerprint));
		strcpy(place->name, client->name);
		strcpy(place->role, client->role);
	}
	place->connections++;
	db_client_address_of_certificate(client->address, place->number, address);
	return true;
}

void db_certificates_let_go(struct db_certificates *certificates, const uint8_t address[16])
{
	struct place *place;
	uint32_t number;

	if (!db_client_certificate_of_address(address, &number))
		return;
	place = find(certificates, number);
	if (place && --place->connections == 0)
		place->left = ++certificates->leavings;
}

bool db_certificates_find(const struct db_certificates *certificates, const uint8_t address[16],
                          const char **name, const char **role)
{
	uint32_t number;

	*name = *role = "";
	if (!db_client_certificate_of_address(address, &number))
		return false;
	for (size_t i = 0; certificates && i < certificates->used; i++) {
		const struct place *place = &certificates->places[i];

		if (place->number != number)
			continue;
		*name = place->name;
		*role = place->role;
		break;
	}
	return true;
}
