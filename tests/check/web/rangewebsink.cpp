int
main ()
{
}
